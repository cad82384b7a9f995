"""Asymmetric friction: more friction one way than the other."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..robot import Robot
from .action import (
    SMOOTH_FRICTION,
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
from .fitted_effect import FittedEffect, times
from .passive_device import passive_device
from .signature import Family, Logged, Member, coefficients_as_named

DESCRIPTION = EffectDescription(
    name="asymmetric_friction",
    title="Asymmetric friction",
    law="friction + offset + viscous_difference·|v|",
    reference='Armstrong-Hélouvry, "Control of Machines with Friction", Kluwer 1991; Swevers, Verdonck & '
    'De Schutter, "Dynamic model identification for industrial robots", IEEE Control Systems 27(5), 2007',
    scope=Scope.JOINT,
    parameters=(
        EffectParameter("offset", "N·m", -np.inf, np.inf, (0.02, 0.3), "coulomb"),
        EffectParameter("viscous_difference", "N·m·s/rad", -np.inf, np.inf, (0.02, 0.25), "viscous"),
    ),
    confused_with=("cable_spring", "gravity_spring", "base_tilt"),
    shown_by=(Experiment.CONSTANT_SPEEDS,),
    # A tenth of friction differs by direction on any joint.
    healthy=5.0,
    sizes=("offset", "viscous_difference"),
    least=0.0024,
)


def action(injection: Injection, simulated: SimulatedRobot) -> Action:
    """Friction that does not change sign with the velocity."""
    joint = require_joint(DESCRIPTION.name, injection.joint, simulated.robot.joints)
    values = [injection.values[name] for name in ("offset", "viscous_difference")]
    return Action((hook(Stage.FRICTION_LEVEL, _even, joint, values),))


@hook_kernel
def _even(bus: int, parameters: int, state: int, joint: int) -> None:
    row, value = bus_row(bus, joint), vector(parameters, 2)
    row[SMOOTH_FRICTION] += value[0] + value[1] * abs(row[VELOCITY])


def signature(runs: Sequence[Logged], joint: int | None, into: int | None) -> Family:
    """1 and |v|."""
    joint = require_joint(DESCRIPTION.name, joint, runs[0].joints)
    columns = on_one_joint(
        runs, lambda run: np.column_stack([np.ones(run.samples), np.abs(run.dq[:, joint])])
    )
    free = np.full(2, np.inf)
    member = Member({}, (joint,), columns, -free, free)
    named = coefficients_as_named(DESCRIPTION, ("offset", "viscous_difference"))
    return Family(DESCRIPTION.name, joint, (member,), named)


def size(fitted: FittedEffect) -> float:
    """The larger of its offset and its difference, as a multiple of a mild one.

    Where friction is little of the torque, any direction's share of it is nothing.
    """
    speed = max(float(fitted.member.rms[1]), float(np.finfo(float).tiny))
    mild = max(fitted.mild("viscous_difference"), fitted.least_torque / speed)
    return max(
        times(fitted.value("offset"), fitted.mild("offset")),
        times(fitted.value("viscous_difference"), mild),
    )


def write(spec: Any, robot: Robot, injection: Injection) -> tuple[str, ...]:
    """The offset as a cogging torque without cycles; MuJoCo's damping is odd in the velocity."""
    joint = require_joint(DESCRIPTION.name, injection.joint, robot.joints)
    offset, difference = (injection.values[name] for name in ("offset", "viscous_difference"))
    if offset != 0.0:
        passive_device(spec, robot, joint, "offset", cogging=(-offset, 0.0, np.pi / 2))
    if difference == 0.0:
        return ()
    return (f"viscous friction that differs by direction ({difference:g} N·m·s/rad·|v|) has no field",)
