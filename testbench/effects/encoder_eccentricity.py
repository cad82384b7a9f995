"""Encoder eccentricity: the reading errs once per revolution."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from identification.parameters import ARMATURE, VISCOUS

from ..robot import Robot
from .action import (
    READING,
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
from .signature import Family, Logged, Member, Quantity, amplitude_and_phase

Array = NDArray[np.float64]

DESCRIPTION = EffectDescription(
    name="encoder_eccentricity",
    title="Encoder eccentricity",
    law="measured position = q + amplitude · sin(q + phase), q the true one; two_harmonics: a quarter of "
    "it twice a revolution too",
    reference='Lopez & Artes, "A new methodology for vibration error compensation of optical encoders", '
    "Sensors 12(4), 2012, sec. 2 (eccentricity of the disc)",
    scope=Scope.JOINT,
    parameters=(
        EffectParameter("amplitude", "rad", 0.0, 0.1, (0.00002, 0.02)),
        EffectParameter("phase", "rad", -2 * np.pi, 2 * np.pi, (-3.1, 3.1)),
    ),
    laws=("once_per_turn", "two_harmonics"),
    confused_with=("encoder_offset", "joint_elasticity", "transmission_ripple"),
    loads=True,
    hinges_only=True,
    of_friction=True,
)
SECOND_HARMONIC = 0.25


def action(injection: Injection, simulated: SimulatedRobot) -> Action:
    """The reading plus its error."""
    joint = require_joint(DESCRIPTION.name, injection.joint, simulated.robot.joints)
    second = SECOND_HARMONIC if injection.law == "two_harmonics" else 0.0
    values = (injection.values["amplitude"], injection.values["phase"], second)
    return Action((hook(Stage.ENCODER, _eccentricity, joint, values),))


@hook_kernel
def _eccentricity(bus: int, parameters: int, state: int, joint: int) -> None:
    row = bus_row(bus, joint)
    amplitude, phase, second = vector(parameters, 3)
    angle = row[READING] + phase
    row[READING] += amplitude * (np.sin(angle) + second * np.sin(2.0 * angle))


def signature(runs: Sequence[Logged], joint: int | None, into: int | None) -> Family:
    """tau along measured - a cos q - b sin q and its derivatives, to first order, at all joints."""
    joint = require_joint(DESCRIPTION.name, joint, runs[0].joints)
    largest = DESCRIPTION.parameters[0].upper
    member = Member(
        shape={},
        rows=tuple(range(runs[0].joints)),
        columns=tuple(_columns(run, joint) for run in runs),
        lower=np.full(2, -largest),
        upper=np.full(2, largest),
    )
    return Family(DESCRIPTION.name, joint, (member,), _parameters)


def _columns(run: Logged, joint: int) -> Array:
    """Added torque for a unit of a and of b, (N, n, 2)."""
    q, dq, ddq = run.q[:, joint], run.dq[:, joint], run.ddq[:, joint]
    cosine, sine = np.cos(q), np.sin(q)
    own = run.table[joint]
    columns = np.empty((run.samples, run.joints, 2))
    for index, (value, slope) in enumerate(((cosine, -sine), (sine, cosine))):
        back = -np.column_stack([value, slope * dq, slope * ddq - value * dq**2])
        columns[:, :, index] = run.load_change(joint, back)
        columns[:, joint, index] += own[VISCOUS] * back[:, 1] + own[ARMATURE] * back[:, 2]
    return columns


def _parameters(member: Member, c: Array, covariance: Array) -> dict[str, Quantity]:
    amplitude, amplitude_std, phase, phase_std = amplitude_and_phase(c[0], c[1], covariance)
    return {
        "amplitude": Quantity(amplitude, amplitude_std, "rad"),
        "phase": Quantity(phase, phase_std, "rad"),
    }


def write(spec: Any, robot: Robot, injection: Injection) -> tuple[str, ...]:
    """There is no form."""
    return (
        "not in the model: MuJoCo's joint sensor reads the joint itself, and no field makes its error vary "
        "with the angle",
    )
