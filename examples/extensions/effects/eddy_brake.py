"""Eddy-current brake: a torque that rises with speed, has a peak, and falls again."""

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
from .signature import Family, Logged, Member, coefficients_as_named, grid_family

DESCRIPTION = EffectDescription(
    name="eddy_brake",
    title="Eddy-current brake",
    law="friction + peak·2x / (1 + x²)·sgn v, x = |v| / critical",
    reference='Smythe, "On eddy currents in a rotating disk", Trans. AIEE 61, 1942',
    scope=Scope.JOINT,
    parameters=(
        EffectParameter("peak", "N·m", 0.0, np.inf, (0.2, 0.8), "coulomb"),
        EffectParameter("critical", "rad/s", 0.05, 50.0, (0.5, 2.0)),
    ),
    confused_with=("nonlinear_viscous_friction", "stribeck_friction"),
    shown_by=(Experiment.CONSTANT_SPEEDS,),
)
CRITICAL = (0.3, 0.7, 1.5, 3.0)


def action(injection: Injection, simulated: SimulatedRobot) -> Action:
    """A level of the set-valued friction that changes with speed, so that rest stays rest."""
    joint = require_joint(DESCRIPTION.name, injection.joint, simulated.robot.joints)
    values = [injection.values[name] for name in ("peak", "critical")]
    return Action((hook(Stage.FRICTION_LEVEL, _level, joint, values),))


@hook_kernel
def _level(bus: int, parameters: int, state: int, joint: int) -> None:
    row, value = bus_row(bus, joint), vector(parameters, 2)
    x = abs(row[VELOCITY]) / value[1]
    row[COULOMB] += value[0] * 2.0 * x / (1.0 + x * x)


def signature(runs: Sequence[Logged], joint: int | None, into: int | None) -> Family:
    """The law on a grid of critical speeds."""
    joint = require_joint(DESCRIPTION.name, joint, runs[0].joints)

    def member(shape: Mapping[str, float]) -> Member:
        def columns(run: Logged) -> NDArray[np.float64]:
            x = run.dq[:, [joint]] / shape["critical"]
            return 2 * x / (1 + x**2)

        return Member(dict(shape), (joint,), on_one_joint(runs, columns), np.zeros(1), np.full(1, np.inf))

    named = coefficients_as_named(DESCRIPTION, ("peak",))
    return grid_family(DESCRIPTION.name, joint, member, {"critical": CRITICAL}, named)


def write(spec: Any, robot: Robot, injection: Injection) -> tuple[str, ...]:
    """MJCF has no such law."""
    return ("a brake whose torque falls with speed, which MJCF has no law for",)
