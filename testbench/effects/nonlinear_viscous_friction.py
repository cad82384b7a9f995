"""Nonlinear viscous friction: a power of the speed beside the linear part."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..robot import Robot
from .action import (
    COULOMB,
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
from .columns import on_one_joint
from .experiment import Experiment
from .fitted_effect import ALL_BUT_ALL, FittedEffect, times
from .mjcf_form import joint_element
from .signature import Family, Logged, Member, coefficients_as_named, grid_family
from .size import scale_of, speed_limit

Array = NDArray[np.float64]

DESCRIPTION = EffectDescription(
    name="nonlinear_viscous_friction",
    title="Nonlinear viscous friction",
    law="friction + coefficient·|v|^exponent·sgn v; saturating: coefficient·log(1 + |v|^exponent)·sgn v",
    reference='Waiboer, Aarts & Jonker, "Velocity dependence of joint friction in robotic manipulators with '
    'gear transmissions", ECCOMAS Multibody Dynamics 2005',
    scope=Scope.JOINT,
    parameters=(
        EffectParameter(
            "coefficient", "N·m·(s/rad)^exponent", -np.inf, np.inf, (0.03, 0.2), "viscous_torque"
        ),
        EffectParameter("exponent", "-", 0.1, 4.0, (0.6, 0.4)),
    ),
    laws=("power", "saturating"),
    confused_with=("stribeck_friction", "thermal_friction_drift"),
    shown_by=(Experiment.CONSTANT_SPEEDS,),
)

EXPONENTS, LEAST, LARGEST = (0.33, 0.5, 0.67, 1.5, 2.0), 0.25, 3.2
# Speeds at which MuJoCo's polynomial is fitted, as shares of the speed limit.
SPEEDS = np.linspace(0.02, 1.0, 50)
# From this exponent on towards one its size falls to nothing.
LEAST_BENT = 0.7
# The typical coefficient is that of a small exponent; one above 1 bends the viscous torque by this share, if
# mildly.
BENT = 0.1
# So many times a mild one is no oil's.
MOST_BENT = 30.0


def action(injection: Injection, simulated: SimulatedRobot) -> Action:
    """A level of the set-valued friction that changes with speed, so that rest stays rest."""
    joint = require_joint(DESCRIPTION.name, injection.joint, simulated.robot.joints)
    values = [injection.values[name] for name in ("coefficient", "exponent")]
    return Action((hook(Stage.FRICTION_LEVEL, _level, joint, [*values, injection.law == "saturating"]),))


@hook_kernel
def _level(bus: int, parameters: int, state: int, joint: int) -> None:
    row, value = bus_row(bus, joint), vector(parameters, 3)
    power = abs(row[VELOCITY]) ** value[1]
    if value[2] > 0.0:
        power = np.log1p(power)
    row[COULOMB] = max(row[COULOMB] + value[0] * power, 0.0)


def signature(runs: Sequence[Logged], joint: int | None, into: int | None) -> Family:
    """The power law on a grid of exponents; it flattens friction by those below 1, and bends it by others.

    Falling by an exponent below 1, steepest at rest, is what Stribeck friction does.
    """
    joint = require_joint(DESCRIPTION.name, joint, runs[0].joints)
    free = np.full(1, np.inf)

    def member(shape: Mapping[str, float]) -> Member:
        def columns(run: Logged) -> Array:
            v = run.dq[:, [joint]]
            return np.abs(v) ** shape["exponent"] * np.sign(v)

        lower = np.zeros(1) if shape["exponent"] < 1 else -free
        return Member(dict(shape), (joint,), on_one_joint(runs, columns), lower, free)

    named = coefficients_as_named(DESCRIPTION, ("coefficient",))
    grid, wider = {"exponent": EXPONENTS}, {"exponent": (LEAST, LARGEST)}
    return grid_family(DESCRIPTION.name, joint, member, grid, named, wider=wider)


def size(fitted: FittedEffect) -> float:
    """Its coefficient as a multiple of a mild one, by as much as its exponent bends friction.

    By an exponent above 1 its torque at the highest speed of the runs, beyond which nothing is known, as a
    multiple of a share of the viscous torque there.
    """
    coefficient, exponent = fitted.value("coefficient"), fitted.value("exponent")
    if exponent > 1:
        power = fitted.member.largest
        speed = power ** (1 / exponent)
        bends = min(exponent * (exponent - 1) / 2, 1.0)
        mild = BENT * speed * scale_of("viscous", fitted.robot, fitted.joint)
        return times(coefficient * (power * bends), mild)
    bends = min((1 - exponent) / (1 - LEAST_BENT), 1.0) if exponent < 1 else 1.0
    return times(coefficient * bends, fitted.mild("coefficient"))


def is_excessive(fitted: FittedEffect, share: float) -> bool:
    """Whether friction bends as no oil's does."""
    return size(fitted) > MOST_BENT and share < ALL_BUT_ALL


def write(spec: Any, robot: Robot, injection: Injection) -> tuple[str, ...]:
    """Polynomial damping a v + b v|v| + c v³: exact for exponents 2 and 3, else fitted."""
    joint = require_joint(DESCRIPTION.name, injection.joint, robot.joints)
    coefficient, exponent = (injection.values[name] for name in ("coefficient", "exponent"))
    element = joint_element(spec, robot, joint)
    fastest = speed_limit(robot.limits, joint)
    speed = SPEEDS * fastest
    power = speed**exponent
    wanted = coefficient * (np.log1p(power) if injection.law == "saturating" else power)
    powers = speed[:, None] ** np.array([1, 2, 3])
    polynomial = np.linalg.lstsq(powers, wanted, rcond=None)[0]
    element.damping = np.asarray(element.damping) + polynomial
    error = float(np.abs(powers @ polynomial - wanted).max())
    if error <= 1e-9 * float(np.abs(wanted).max()):
        return ()
    return (f"fitted by v, v|v| and v³ up to {fastest:.3g} rad/s, to {error:.2g} N·m",)
