"""Presliding hysteresis: before it slides, friction is a spring of bristles that yields."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

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
from .bristle import bristle_step, dahl_step, unit_bristle
from .columns import on_one_joint
from .experiment import Experiment
from .fitted_effect import FittedEffect
from .passive_device import coulomb_level, passive_device
from .signature import Family, Logged, Member, Quantity
from .size import scale_of

Array = NDArray[np.float64]

DESCRIPTION = EffectDescription(
    name="presliding_hysteresis",
    title="Presliding hysteresis",
    law="Coulomb friction is stiffness·z, dz/dt = v - stiffness·|v|·z / level (dahl); lugre adds damping of "
    "the bristles, elasto_plastic has no slip below 70 % of the level; dahl_exponent: "
    "dz/dt = v·(1 - sgn v·stiffness·z / level)^exponent",
    reference='Dahl, "A solid friction model", 1968, and AIAA Journal 14(12), 1976; Canudas de Wit, Olsson, '
    "Åström & Lischinsky, IEEE TAC 40(3), 1995; Dupont, Hayward, Armstrong & Altpeter, IEEE TAC 47(5), 2002",
    scope=Scope.JOINT,
    parameters=(
        EffectParameter("stiffness", "N·m/rad", 0.0, np.inf, (1500.0, 200.0), "coulomb"),
        EffectParameter("exponent", "-", 0.0, 4.0, (2.0, 2.0), law="dahl_exponent"),
    ),
    laws=("dahl", "lugre", "elasto_plastic", "dahl_exponent"),
    confused_with=("stribeck_friction", "backlash"),
    shown_by=(Experiment.SMALL_REVERSALS,),
    yields=True,
    laws_apart=True,
    # Any joint may yield by a fifth of a milliradian, and bristles that do not slip at first seem too stiff.
    healthy=0.4,
)

LUGRE, ELASTO_PLASTIC, DAHL_EXPONENT = DESCRIPTION.laws[1:]
# Share of the level below which elasto-plastic bristles do not slip at all.
BREAKAWAY = 0.7
# LuGre's bristles: damping ratio with the joint's inertia.
BRISTLE_DAMPING_RATIO = 0.1
DISPLACEMENTS = (0.0003, 0.001, 0.002, 0.004, 0.008)
# What is refined may be stiffer: a healthy joint's bristles look like these where the range ends at them.
SHORTEST = 0.00005
# Beside Dahl's own of one, which is met most: bearings yield longer, what sticks and breaks not as long. The
# latter looks much like his own, so that the former alone is looked for first.
LIKELY_EXPONENT, EXPONENTS = 2.0, (0.2, 3.0)
# Bristles bear all of a joint's Coulomb friction: with less than this share it is another hysteresis.
SMALLEST_LEVEL = 0.55
# An encoder that counts in no less than this part of their displacement looks like them.
COUNTS = 2.5


def action(injection: Injection, simulated: SimulatedRobot) -> Action:
    """A bristle in place of the set-valued friction; infinitely stiff bristles are that friction."""
    joint = require_joint(DESCRIPTION.name, injection.joint, simulated.robot.joints)
    stiffness = injection.values["stiffness"]
    if np.isinf(stiffness):
        return Action()
    damping = 2 * _damping_ratio(injection) * np.sqrt(stiffness * simulated.inertia[joint])
    exponent = injection.values["exponent"] if injection.law == DAHL_EXPONENT else 1.0
    values = [stiffness, damping, exponent, injection.law == ELASTO_PLASTIC]
    return Action((hook(Stage.FRICTION_STATE, _bristle, joint, values, state=1),))


def _damping_ratio(injection: Injection) -> float:
    """Of the bristles with the joint's inertia; only LuGre's are damped."""
    return BRISTLE_DAMPING_RATIO if injection.law == LUGRE else 0.0


@hook_kernel
def _bristle(bus: int, parameters: int, state: int, joint: int) -> None:
    row, value, deflection = bus_row(bus, joint), vector(parameters, 4), vector(state, 1)
    stiffness, level, before = value[0], row[COULOMB], deflection[0]
    row[COULOMB] = 0.0
    if stiffness <= 0.0 or level <= 0.0:
        return
    velocity, timestep = row[VELOCITY], row[TIMESTEP]
    if value[3] > 0.0:
        strain = stiffness * abs(before) / level
        slipping = 0.0
        # A bristle that is let go springs back without slip.
        if before * velocity > 0.0 and strain > BREAKAWAY:
            slipping = 0.5 - 0.5 * np.cos(np.pi * min((strain - BREAKAWAY) / (1.0 - BREAKAWAY), 1.0))
        deflection[0] = bristle_step(before, velocity, level, stiffness, slipping, timestep)
    else:
        deflection[0] = dahl_step(before, velocity, level, stiffness, value[2], timestep)
    rate = (deflection[0] - before) / timestep
    row[SMOOTH_FRICTION] += stiffness * deflection[0] + value[1] * rate


def signature(runs: Sequence[Logged], joint: int | None, into: int | None) -> Family:
    """Dahl's bristle less sgn v, a unit of level, on a grid of displacements level / stiffness.

    By his law, and by that with an exponent.
    """
    joint = require_joint(DESCRIPTION.name, joint, runs[0].joints)

    def member(shape: Mapping[str, float]) -> Member:
        def columns(run: Logged) -> Array:
            v = np.ascontiguousarray(run.dq[:, joint])
            friction = np.empty((run.samples, 1))
            displacement, exponent = np.array([shape["displacement"]]), shape.get("exponent", 1.0)
            unit_bristle(v, displacement, exponent, 1 / run.sample_rate, friction)
            return friction - np.sign(v)[:, None]

        law, made = DAHL_EXPONENT if "exponent" in shape else None, on_one_joint(runs, columns)
        return Member(dict(shape), (joint,), made, np.zeros(1), np.full(1, np.inf), law)

    shapes = [{"displacement": each} for each in DISPLACEMENTS]
    shapes += [{**each, "exponent": LIKELY_EXPONENT} for each in shapes]
    return Family(
        effect=DESCRIPTION.name,
        joint=joint,
        members=tuple(member(each) for each in shapes),
        parameters=_parameters,
        refine={"displacement": (SHORTEST, DISPLACEMENTS[-1]), "exponent": EXPONENTS},
        member=member,
    )


def _parameters(member: Member, c: Array, covariance: Array) -> dict[str, Quantity]:
    """Stiffness = level / displacement, with its first-order standard deviation."""
    displacement = member.shape["displacement"]
    stiffness = float(c[0]) / displacement
    own = covariance[:2, :2]
    gradient = np.array([1 / displacement, -stiffness / displacement])[: len(own)]
    found = {"stiffness": Quantity(stiffness, float(np.sqrt(gradient @ own @ gradient)), "N·m/rad")}
    if "exponent" in member.shape:
        std = float(np.sqrt(max(covariance[2, 2], 0.0)))
        found["exponent"] = Quantity(member.shape["exponent"], std, "-")
    return found


def is_distinct(fitted: FittedEffect) -> bool:
    """Whether it bears the joint's Coulomb friction, over a displacement that the encoder resolves."""
    level = SMALLEST_LEVEL * scale_of("coulomb", fitted.robot, fitted.joint)
    resolved = fitted.member.shape["displacement"] > COUNTS * fitted.position_step
    return bool(resolved and fitted.coefficients[0] >= level)


def write(spec: Any, robot: Robot, injection: Injection) -> tuple[str, ...]:
    """LuGre friction of a passive dcmotor in place of the frictionloss."""
    joint = require_joint(DESCRIPTION.name, injection.joint, robot.joints)
    if np.isinf(injection.values["stiffness"]):
        return ()
    coulomb = coulomb_level(spec, robot, joint)
    if coulomb == 0.0:
        coulomb = float(robot.parameters.reshape(robot.chain.links, -1)[joint, COULOMB_PARAMETER])
    bristles = injection.values["stiffness"], _damping_ratio(injection)
    passive_device(spec, robot, joint, "bristles", lugre=(coulomb, coulomb, 1.0), bristles=bristles)
    if injection.law == ELASTO_PLASTIC:
        return ("MuJoCo's bristles are LuGre's: they creep below the breakaway deflection",)
    if injection.law == DAHL_EXPONENT:
        return ("MuJoCo's bristles are LuGre's: they yield by an exponent of one",)
    return ()
