"""Gravity spring: a counterbalance whose torque is a sine of the joint's position."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..robot import Robot
from .action import (
    LINK_POSITION,
    LINK_TORQUE,
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
from .passive_device import passive_device
from .signature import Family, Logged, Member, Quantity, amplitude_and_phase, single_joint

Array = NDArray[np.float64]

DESCRIPTION = EffectDescription(
    name="gravity_spring",
    title="Gravity spring",
    law="stiffness·sin(phase - q) added to the drive; gas_spring: a constant force between anchors at "
    "radius 1 and 1/2, stiffness·sin(phase - q)·0.5 / sqrt(1.25 - cos(phase - q))",
    reference='Swevers, Verdonck & De Schutter, "Dynamic model identification for industrial robots", IEEE '
    "Control Systems 27(5), 2007",
    scope=Scope.JOINT,
    parameters=(
        EffectParameter("stiffness", "N·m", 0.0, np.inf, (0.1, 0.6), "gravity"),
        EffectParameter("phase", "rad", -2 * np.pi, 2 * np.pi, (0.0, 1.0)),
    ),
    laws=("sine", "gas_spring"),
    confused_with=("cable_spring", "payload", "encoder_offset", "base_tilt"),
)


def action(injection: Injection, simulated: SimulatedRobot) -> Action:
    """A torque on the link."""
    joint = require_joint(DESCRIPTION.name, injection.joint, simulated.robot.joints)
    values = [injection.values[name] for name in ("stiffness", "phase")]
    return Action((hook(Stage.TORQUE, _spring, joint, [*values, injection.law == "gas_spring"]),))


@hook_kernel
def _spring(bus: int, parameters: int, state: int, joint: int) -> None:
    row, value = bus_row(bus, joint), vector(parameters, 3)
    angle = value[1] - row[LINK_POSITION]
    torque = value[0] * np.sin(angle)
    if value[2] > 0.0:
        # A constant force between anchors at radius 1 and 1/2: lever arm over length.
        torque *= 0.5 / np.sqrt(1.25 - np.cos(angle))
    row[LINK_TORQUE] += torque


def signature(runs: Sequence[Logged], joint: int | None, into: int | None) -> Family:
    """sin q and cos q: -stiffness·sin(phase - q) = stiffness·sin(q - phase)."""
    joint = require_joint(DESCRIPTION.name, joint, runs[0].joints)
    columns = [np.column_stack([np.cos(run.q[:, joint]), np.sin(run.q[:, joint])]) for run in runs]
    free = np.full(2, np.inf)
    member = Member({}, (joint,), single_joint(columns), -free, free)
    return Family(DESCRIPTION.name, joint, (member,), _parameters, swallowed=True)


def _parameters(member: Member, c: Array, covariance: Array) -> dict[str, Quantity]:
    stiffness, stiffness_std, phase, phase_std = amplitude_and_phase(float(c[0]), float(c[1]), covariance)
    return {
        "stiffness": Quantity(stiffness, stiffness_std, "N·m"),
        "phase": Quantity(-phase, phase_std, "rad"),
    }


def write(spec: Any, robot: Robot, injection: Injection) -> tuple[str, ...]:
    """The cogging torque of a passive dcmotor with one cycle a revolution."""
    joint = require_joint(DESCRIPTION.name, injection.joint, robot.joints)
    stiffness, phase = (injection.values[name] for name in ("stiffness", "phase"))
    passive_device(spec, robot, joint, "spring", cogging=(stiffness, 1.0, np.pi - phase))
    if injection.law == "gas_spring":
        return ("the gas spring's changing length is left out, its torque is a pure sine",)
    return ()
