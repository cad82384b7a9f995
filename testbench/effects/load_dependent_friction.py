"""Load-dependent friction: the Coulomb level grows with the torque the gearbox carries."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..robot import Robot
from .action import (
    COULOMB,
    LOAD,
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
from .fitted_effect import ALL_BUT_ALL, FittedEffect
from .signature import Family, Logged, Member, coefficients_as_named

Array = NDArray[np.float64]

DESCRIPTION = EffectDescription(
    name="load_dependent_friction",
    title="Load-dependent friction",
    law="friction + coefficient·|tau_load|·sgn v; driving: half of it where the load drives the motor",
    reference='Hamon, Gautier & Garrec, "Dynamic identification of robots with a dry friction model '
    'depending on load and velocity", IROS 2010; Bittencourt & Gunnarsson, J. Dyn. Sys. 134(5), 2012',
    scope=Scope.JOINT,
    parameters=(EffectParameter("coefficient", "-", 0.0, 1.0, (0.03, 0.15)),),
    laws=("symmetric", "driving"),
    confused_with=("gravity_spring", "stribeck_friction", "torque_gain_error"),
    shown_by=(Experiment.TWO_LOADS,),
    of_friction=True,
)
_, DRIVING = DESCRIPTION.laws
# Share of it where the load drives the motor, by the second law.
DRIVEN = 0.5
# No gear loses so many times the severe end's share of its load. Worms and small gears lose more; there it
# explains all but all.
MOST = 1.5


def action(injection: Injection, simulated: SimulatedRobot) -> Action:
    """A level of the set-valued friction that follows the load of the step before."""
    joint = require_joint(DESCRIPTION.name, injection.joint, simulated.robot.joints)
    values = [injection.values["coefficient"], injection.law == DRIVING]
    return Action((hook(Stage.FRICTION_LEVEL, _level, joint, values),))


@hook_kernel
def _level(bus: int, parameters: int, state: int, joint: int) -> None:
    row, value = bus_row(bus, joint), vector(parameters, 2)
    driven = value[1] > 0.0 and row[LOAD] * row[VELOCITY] < 0.0
    row[COULOMB] += (DRIVEN if driven else 1.0) * value[0] * abs(row[LOAD])


def signature(runs: Sequence[Logged], joint: int | None, into: int | None) -> Family:
    """|tau_load|·sgn v with the load of the rigid-body model; half of it where that drives the motor."""
    joint = require_joint(DESCRIPTION.name, joint, runs[0].joints)
    upper = np.array([DESCRIPTION.parameters[0].upper])

    def member(shape: dict[str, float], law: str | None) -> Member:
        def columns(run: Logged) -> Array:
            load, direction = run.load[:, joint], run.direction[:, joint]
            driven = np.where(load * direction < 0, shape.get("driven", 1.0), 1.0)
            return (driven * np.abs(load) * direction)[:, None]

        return Member(shape, (joint,), on_one_joint(runs, columns), np.zeros(1), upper, law)

    members = member({}, None), member({"driven": DRIVEN}, DRIVING)
    return Family(DESCRIPTION.name, joint, members, coefficients_as_named(DESCRIPTION, ("coefficient",)))


def is_excessive(fitted: FittedEffect, share: float) -> bool:
    """Whether it grows with the load as no gear's friction does."""
    _, severe = fitted.typical("coefficient")
    return fitted.value("coefficient") > MOST * severe and share < ALL_BUT_ALL


def write(spec: Any, robot: Robot, injection: Injection) -> tuple[str, ...]:
    """MuJoCo's frictionloss is a constant."""
    return ("MJCF has no joint friction that depends on the load",)
