"""Stribeck friction: more friction at low speed, before a lubricating film has formed."""

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
from .passive_device import coulomb_level, passive_device
from .signature import Family, Logged, Member, coefficients_as_named, grid_family

Array = NDArray[np.float64]

DESCRIPTION = EffectDescription(
    name="stribeck_friction",
    title="Stribeck friction",
    law="friction + extra·exp(-(|v| / velocity)^exponent)·sgn v; rational: "
    "friction + extra / (1 + (|v| / velocity)^exponent)·sgn v",
    reference='Bo & Pavelescu, "The friction-speed relation and its influence on the critical velocity of '
    'stick-slip motion", Wear 82(3), 1982; Armstrong-Hélouvry, Dupont & Canudas de Wit, Automatica 30, 1994',
    scope=Scope.JOINT,
    parameters=(
        EffectParameter("extra", "N·m", 0.0, np.inf, (0.1, 0.8), "coulomb"),
        EffectParameter("velocity", "rad/s", 1e-4, 10.0, (0.08, 0.3)),
        EffectParameter("exponent", "-", 0.3, 4.0, (1.0, 2.0)),
    ),
    laws=("exponential", "rational"),
    confused_with=("presliding_hysteresis", "nonlinear_viscous_friction", "backlash"),
    shown_by=(Experiment.SMALL_REVERSALS, Experiment.CONSTANT_SPEEDS),
    falls=True,
    of_friction=True,
    healthy=1.0,
)

VELOCITIES = (0.03, 0.08, 0.16, 0.3, 0.6)
EXPONENTS = (1.0, 1.7, 3.0)


def action(injection: Injection, simulated: SimulatedRobot) -> Action:
    """A level of the set-valued friction that falls with speed."""
    joint = require_joint(DESCRIPTION.name, injection.joint, simulated.robot.joints)
    values = [injection.values[name] for name in ("extra", "velocity", "exponent")]
    rational = injection.law == "rational"
    return Action((hook(Stage.FRICTION_LEVEL, _level, joint, [*values, rational]),))


@hook_kernel
def _level(bus: int, parameters: int, state: int, joint: int) -> None:
    row, value = bus_row(bus, joint), vector(parameters, 4)
    ratio = (abs(row[VELOCITY]) / value[1]) ** value[2]
    share = 1.0 / (1.0 + ratio) if value[3] > 0.0 else np.exp(-ratio)
    row[COULOMB] += value[0] * share


def signature(runs: Sequence[Logged], joint: int | None, into: int | None) -> Family:
    """The exponential law on a grid of velocities and exponents."""
    joint = require_joint(DESCRIPTION.name, joint, runs[0].joints)

    def member(shape: Mapping[str, float]) -> Member:
        def columns(run: Logged) -> Array:
            ratio = (np.abs(run.dq[:, joint]) / shape["velocity"]) ** shape["exponent"]
            return (np.exp(-ratio) * run.direction[:, joint])[:, None]

        return Member(dict(shape), (joint,), on_one_joint(runs, columns), np.zeros(1), np.full(1, np.inf))

    named = coefficients_as_named(DESCRIPTION, ("extra",))
    grid = {"velocity": VELOCITIES, "exponent": EXPONENTS}
    return grid_family(DESCRIPTION.name, joint, member, grid, named)


def write(spec: Any, robot: Robot, injection: Injection) -> tuple[str, ...]:
    """LuGre friction of a passive dcmotor, whose steady state is Stribeck's curve with exponent 2."""
    joint = require_joint(DESCRIPTION.name, injection.joint, robot.joints)
    coulomb, extra = coulomb_level(spec, robot, joint), injection.values["extra"]
    velocity = injection.values["velocity"]
    passive_device(spec, robot, joint, "stribeck", lugre=(coulomb, coulomb + extra, velocity))
    if injection.values["exponent"] == 2.0 and injection.law == "exponential":
        return ()
    return ("MuJoCo's friction falls with exp(-(v / velocity)²), whatever exponent and law are given",)
