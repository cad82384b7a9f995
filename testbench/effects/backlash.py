"""Backlash: play between motor and link."""

from collections.abc import Mapping, Sequence
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from identification.kinematics import kernel

from ..robot import Robot
from .action import (
    HALF_GAP,
    STIFFNESS,
    Action,
    SimulatedRobot,
    Stage,
    bus_row,
    hook,
    hook_kernel,
    require_joint,
    vector,
)
from .base import EffectDescription, EffectParameter, Injection, Scope
from .joint_elasticity import add_link_joint
from .mjcf_form import file_angle
from .signature import Family, Logged, Member, Quantity, grid_family

Array = NDArray[np.float64]

DESCRIPTION = EffectDescription(
    name="backlash",
    title="Backlash",
    law="no torque while |q_motor - q_link| < gap / 2; beyond, a hard damped contact that pushes and never "
    "pulls (dead_zone); soft_contact: a contact a quarter as stiff",
    reference='Nordin & Gutman, "Controlling mechanical systems with backlash", Automatica 38, 2002',
    scope=Scope.JOINT,
    parameters=(EffectParameter("gap", "rad", 0.0, 0.1, (0.0005, 0.006)),),
    laws=("dead_zone", "soft_contact"),
    confused_with=("presliding_hysteresis", "stribeck_friction", "joint_elasticity"),
)

SOFT_CONTACT = 0.25
GAPS = (0.0003, 0.0008, 0.0016, 0.003, 0.006)


def action(injection: Injection, simulated: SimulatedRobot) -> Action:
    """Play in the transmission of a split joint; without play the joint is rigid."""
    joint = require_joint(DESCRIPTION.name, injection.joint, simulated.robot.joints)
    gap = injection.values["gap"]
    if gap == 0.0:
        return Action()
    softness = SOFT_CONTACT if injection.law == "soft_contact" else 1.0
    return Action((hook(Stage.TRANSMISSION, _play, joint, [gap / 2, softness]),), split=joint)


@hook_kernel
def _play(bus, parameters, state, joint):  # type: ignore[no-untyped-def]
    row, value = bus_row(bus, joint), vector(parameters, 2)
    row[HALF_GAP] += value[0]
    row[STIFFNESS] *= value[1]


def signature(runs: Sequence[Logged], joint: int | None, into: int | None) -> Family:
    """The torque that the motor is spared while the link crosses the gap, and the push when it lands.

    The link follows the motor until the load changes sign, then flies freely across; landing is
    inelastic. One column a gap, whose coefficient is 1 where the gap is right. The load is that of the
    measured motion: the kick of a landing is in it, and a reference knows nothing of when it lands.
    """
    joint = require_joint(DESCRIPTION.name, joint, runs[0].joints)
    inertia = [run.load_change(joint, np.array([[0.0, 0.0, 1.0]]))[:, joint] for run in runs]

    def member(shape: Mapping[str, float]) -> Member:
        columns = []
        for run, own in zip(runs, inertia, strict=True):
            column = np.empty(run.samples)
            load = np.ascontiguousarray(run.load[:, joint])
            _crossings(load, np.ascontiguousarray(own), shape["gap"], 1 / run.sample_rate, column)
            columns.append(column[:, None, None])
        return Member(dict(shape), (joint,), tuple(columns), np.zeros(1), np.full(1, 2.0))

    def parameters(member: Member, c: Array, covariance: Array) -> dict[str, Quantity]:
        std = float(np.sqrt(max(covariance[1, 1], 0.0))) if len(covariance) > 1 else 0.0
        return {"gap": Quantity(member.shape["gap"], std, "rad")}

    return grid_family(DESCRIPTION.name, joint, member, {"gap": GAPS}, parameters)


@kernel
def _crossings(load, inertia, gap, timestep, out):  # type: ignore[no-untyped-def]
    """Transmitted torque less the load of a link that follows rigidly, (N,).

    load: (N,) N·m. inertia: (N,) kg·m² of the link. The motor leads the link by x in [0, gap] from the
    lower wall; in the air inertia·d²x/dt² = load.
    """
    rate = 0.0
    place = gap if load[0] > 0.0 else 0.0
    for t in range(load.size):
        upper, lower = place >= gap and load[t] >= 0.0, place <= 0.0 and load[t] <= 0.0
        if upper or lower:
            place, rate = (gap if upper else 0.0), 0.0
            out[t] = 0.0
            continue
        out[t] = -load[t]
        rate += timestep * load[t] / inertia[t]
        place += timestep * rate
        if place >= gap or place <= 0.0:
            # Landing: what the link has gained over the motor goes into the motor at once.
            out[t] += inertia[t] * rate / timestep
            place = gap if place >= gap else 0.0
            rate = 0.0


def write(spec: Any, robot: Robot, injection: Injection) -> tuple[str, ...]:
    """A second joint about the same axis, limited to the gap; the first keeps rotor, friction and motor."""
    joint = require_joint(DESCRIPTION.name, injection.joint, robot.joints)
    gap = injection.values["gap"]
    if gap == 0.0:
        return ()
    link = add_link_joint(spec, robot, joint, "backlash")
    half = file_angle(spec, robot, joint, gap / 2)
    link.limited = mujoco.mjtLimited.mjLIMITED_TRUE
    link.range = [-half, half]
    # As stiff as the step allows; MuJoCo asks for at least two steps.
    link.solref_limit = [2 * spec.option.timestep, 1.0]
    return ("contact at the ends of the gap is MuJoCo's soft limit, without the compliance of the teeth",)
