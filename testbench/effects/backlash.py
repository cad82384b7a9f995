"""Backlash: play between motor and link."""

from collections.abc import Mapping, Sequence
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

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
from .columns import by_run
from .experiment import Experiment
from .joint_elasticity import add_link_joint
from .link_motion import link_row, loose_change
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
    parameters=(EffectParameter("gap", "rad", 0.0, 0.1, (0.0001, 0.004)),),
    laws=("dead_zone", "soft_contact"),
    confused_with=("presliding_hysteresis", "stribeck_friction", "joint_elasticity"),
    shown_by=(Experiment.HIGH_FREQUENCIES, Experiment.SMALL_REVERSALS),
    of_transmission=True,
    relinearised=True,
    laws_apart=True,
)

SOFT_CONTACT = 0.25
# s, of MuJoCo's limit at the ends of the gap: about as hard as the contact in simulation/transmission.py.
LIMIT_TIME_CONSTANT = 0.004
GAPS, WIDEST = (0.0001, 0.0002, 0.0004, 0.0008, 0.0015, 0.003, 0.006, 0.013), 0.04
# Hz, of a hard contact with the link's own inertia: what is looked for first, and what it may be.
CONTACT, CONTACTS = 60.0, (30.0, 160.0)


def action(injection: Injection, simulated: SimulatedRobot) -> Action:
    """Play in the transmission of a split joint; without play the joint is rigid."""
    joint = require_joint(DESCRIPTION.name, injection.joint, simulated.robot.joints)
    gap = injection.values["gap"]
    if gap == 0.0:
        return Action()
    softness = SOFT_CONTACT if injection.law == "soft_contact" else 1.0
    return Action((hook(Stage.TRANSMISSION, _play, joint, [gap / 2, softness]),), split=joint)


@hook_kernel
def _play(bus: int, parameters: int, state: int, joint: int) -> None:
    row, value = bus_row(bus, joint), vector(parameters, 2)
    row[HALF_GAP] += value[0]
    row[STIFFNESS] *= value[1]


def signature(runs: Sequence[Logged], joint: int | None, into: int | None) -> Family:
    """The change of torque while the link crosses the gap and when it lands, at all joints.

    One column a gap, whose coefficient is 1 where the gap is right. The load is that of the measured
    motion: the kick of a landing is in it, and a reference knows nothing of when it lands.
    """
    joint = require_joint(DESCRIPTION.name, joint, runs[0].joints)
    rows = tuple(range(runs[0].joints))

    def member(shape: Mapping[str, float]) -> Member:
        play = shape["gap"], shape["contact"]
        columns = by_run(runs, lambda run: loose_change(link_row(run, joint), *play)[:, :, None])
        return Member(dict(shape), rows, columns, np.zeros(1), np.full(1, 2.0))

    def parameters(member: Member, c: Array, covariance: Array) -> dict[str, Quantity]:
        std = float(np.sqrt(max(covariance[1, 1], 0.0))) if len(covariance) > 1 else 0.0
        # Time and force of the link's landing give different gaps where teeth are not as modelled.
        return {"gap": Quantity(float(member.shape["gap"] * np.sqrt(max(c[0], 0.0))), std, "rad")}

    grid = {"gap": GAPS, "contact": (CONTACT,)}
    wider = {"gap": (GAPS[0], WIDEST), "contact": CONTACTS}
    return grid_family(DESCRIPTION.name, joint, member, grid, parameters, wider=wider)


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
    # MuJoCo asks for at least two steps.
    link.solref_limit = [max(LIMIT_TIME_CONSTANT, 2 * spec.option.timestep), 1.0]
    return ("contact at the ends of the gap is MuJoCo's soft limit, critically damped",)
