"""Presliding hysteresis: before it slides, friction is a spring of bristles that yields."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from identification.parameters import COULOMB as COULOMB_PARAMETER

from ..robot import Robot
from .action import (
    COULOMB,
    SMOOTH_FRICTION,
    TIMESTEP,
    VELOCITY,
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
from .bristle import bristle_step, unit_bristle
from .passive_device import coulomb_level, passive_device
from .signature import Family, Logged, Member, Quantity, grid_family, single_joint

DESCRIPTION = EffectDescription(
    name="presliding_hysteresis",
    title="Presliding hysteresis",
    law="Coulomb friction is stiffness·z, dz/dt = v - stiffness·|v|·z / level (dahl); lugre adds damping of "
    "the bristles, elasto_plastic has no slip below 70 % of the level",
    reference='Dahl, "A solid friction model", 1968; Canudas de Wit, Olsson, Åström & Lischinsky, IEEE TAC '
    "40(3), 1995; Dupont, Hayward, Armstrong & Altpeter, IEEE TAC 47(5), 2002",
    scope=Scope.JOINT,
    parameters=(EffectParameter("stiffness", "N·m/rad", 0.0, np.inf, (1500.0, 200.0), "coulomb"),),
    laws=("dahl", "lugre", "elasto_plastic"),
    confused_with=("stribeck_friction", "backlash"),
)

DAHL, LUGRE, ELASTO_PLASTIC = range(3)
# Share of the level below which elasto-plastic bristles do not slip at all.
BREAKAWAY = 0.7
# LuGre's bristles: damping ratio with the joint's inertia.
BRISTLE_DAMPING_RATIO = 0.1
DISPLACEMENTS = (0.0003, 0.001, 0.002, 0.004, 0.008)


def action(injection: Injection, simulated: SimulatedRobot) -> Action:
    """A bristle in place of the set-valued friction; infinitely stiff bristles are that friction."""
    joint = require_joint(DESCRIPTION.name, injection.joint, simulated.robot.joints)
    stiffness = injection.values["stiffness"]
    if np.isinf(stiffness):
        return Action()
    damping = 2 * _damping_ratio(injection) * np.sqrt(stiffness * simulated.inertia[joint])
    values = [stiffness, damping, DESCRIPTION.laws.index(injection.law)]
    return Action((hook(Stage.FRICTION_STATE, _bristle, joint, values, state=1),))


def _damping_ratio(injection: Injection) -> float:
    """Of the bristles with the joint's inertia; only LuGre's are damped."""
    return BRISTLE_DAMPING_RATIO if injection.law == "lugre" else 0.0


@hook_kernel
def _bristle(bus: int, parameters: int, state: int, joint: int) -> None:
    row, value, deflection = bus_row(bus, joint), vector(parameters, 3), vector(state, 1)
    stiffness, level, before = value[0], row[COULOMB], deflection[0]
    row[COULOMB] = 0.0
    if stiffness <= 0.0 or level <= 0.0:
        return
    velocity, timestep = row[VELOCITY], row[TIMESTEP]
    slipping = 1.0
    if value[2] == ELASTO_PLASTIC:
        strain = stiffness * abs(before) / level
        slipping = 0.0
        # A bristle that is let go springs back without slip.
        if before * velocity > 0.0 and strain > BREAKAWAY:
            slipping = 0.5 - 0.5 * np.cos(np.pi * min((strain - BREAKAWAY) / (1.0 - BREAKAWAY), 1.0))
    deflection[0] = bristle_step(before, velocity, level, stiffness, slipping, timestep)
    rate = (deflection[0] - before) / timestep
    row[SMOOTH_FRICTION] += stiffness * deflection[0] + value[1] * rate


def signature(runs: Sequence[Logged], joint: int | None, into: int | None) -> Family:
    """Dahl's bristle less sgn v, a unit of level, on a grid of displacements level / stiffness."""
    joint = require_joint(DESCRIPTION.name, joint, runs[0].joints)

    def member(shape: Mapping[str, float]) -> Member:
        columns = []
        for run in runs:
            v = np.ascontiguousarray(run.dq[:, joint])
            friction = np.empty((run.samples, 1))
            unit_bristle(v, np.array([shape["displacement"]]), 1 / run.sample_rate, friction)
            columns.append(friction - np.sign(v)[:, None])
        return Member(dict(shape), (joint,), single_joint(columns), np.zeros(1), np.full(1, np.inf))

    def parameters(member: Member, c: np.ndarray, covariance: np.ndarray) -> dict[str, Quantity]:
        displacement = member.shape["displacement"]
        stiffness = float(c[0]) / displacement
        gradient = np.array([1 / displacement, -stiffness / displacement])[: len(covariance)]
        return {"stiffness": Quantity(stiffness, float(np.sqrt(gradient @ covariance @ gradient)), "N·m/rad")}

    return grid_family(DESCRIPTION.name, joint, member, {"displacement": DISPLACEMENTS}, parameters)


def write(spec: Any, robot: Robot, injection: Injection) -> tuple[str, ...]:
    """LuGre friction of a passive dcmotor in place of the frictionloss."""
    joint = require_joint(DESCRIPTION.name, injection.joint, robot.joints)
    if np.isinf(injection.values["stiffness"]):
        return ()
    coulomb = coulomb_level(spec, robot, joint)
    if coulomb == 0.0:
        coulomb = float(robot.parameters.reshape(robot.joints, -1)[joint, COULOMB_PARAMETER])
    bristles = injection.values["stiffness"], _damping_ratio(injection)
    passive_device(spec, robot, joint, "bristles", lugre=(coulomb, coulomb, 1.0), bristles=bristles)
    if injection.law == "elasto_plastic":
        return ("MuJoCo's bristles are LuGre's: they creep below the breakaway deflection",)
    return ()
