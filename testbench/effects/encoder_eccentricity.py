"""Encoder eccentricity: the reading errs once per revolution."""

from collections.abc import Mapping, Sequence
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
from .columns import by_run
from .experiment import Experiment
from .signature import Family, Logged, Member, Quantity, wave_parameters

Array = NDArray[np.float64]

TWO_HARMONICS = "two_harmonics"

DESCRIPTION = EffectDescription(
    name="encoder_eccentricity",
    title="Encoder eccentricity",
    law="measured position = q + amplitude·sin(q + phase), q the true one; two_harmonics adds "
    "second_amplitude·sin(2·q + second_phase)",
    reference='Lopez & Artes, "A new methodology for vibration error compensation of optical encoders", '
    "Sensors 12(4), 2012, sec. 2 (eccentricity of the disc)",
    scope=Scope.JOINT,
    parameters=(
        EffectParameter("amplitude", "rad", 0.0, 0.1, (0.00002, 0.02)),
        EffectParameter("phase", "rad", -2 * np.pi, 2 * np.pi, (-3.1, 3.1)),
        EffectParameter("second_amplitude", "rad", 0.0, 0.1, (0.000005, 0.005), law=TWO_HARMONICS),
        EffectParameter("second_phase", "rad", -2 * np.pi, 2 * np.pi, (-3.1, 3.1), law=TWO_HARMONICS),
    ),
    laws=("once_per_turn", TWO_HARMONICS),
    confused_with=("encoder_offset", "joint_elasticity", "transmission_ripple"),
    shown_by=(Experiment.TWO_SLOW_SPEEDS,),
    of_encoder=True,
    relinearised=True,
    loads=True,
    hinges_only=True,
    of_friction=True,
    # Small errors of an encoder are what other imperfections of a loaded joint look like.
    healthy=500.0,
)

# Shape of one that has two: how many.
HARMONICS = "harmonics"


def action(injection: Injection, simulated: SimulatedRobot) -> Action:
    """The reading plus its error."""
    joint = require_joint(DESCRIPTION.name, injection.joint, simulated.robot.joints)
    values = [injection.values[name] for name in ("amplitude", "phase")]
    # A second harmonic of nothing, where there is none.
    values += [injection.values.get(name, 0.0) for name in ("second_amplitude", "second_phase")]
    return Action((hook(Stage.ENCODER, _eccentricity, joint, values),))


@hook_kernel
def _eccentricity(bus: int, parameters: int, state: int, joint: int) -> None:
    row = bus_row(bus, joint)
    amplitude, phase, second, second_phase = vector(parameters, 4)
    angle = row[READING]
    row[READING] += amplitude * np.sin(angle + phase) + second * np.sin(2.0 * angle + second_phase)


def signature(runs: Sequence[Logged], joint: int | None, into: int | None) -> Family:
    """tau along measured - a cos q - b sin q and its derivatives, to first order, at all joints.

    By the law of two harmonics with the same of 2 q.
    """
    joint = require_joint(DESCRIPTION.name, joint, runs[0].joints)
    largest = DESCRIPTION.parameters[0].upper

    def member(shape: Mapping[str, float]) -> Member:
        orders = range(1, 1 + int(shape.get(HARMONICS, 1)))
        return Member(
            shape=dict(shape),
            rows=tuple(range(runs[0].joints)),
            columns=by_run(runs, lambda run: _columns(run, joint, orders)),
            lower=np.full(2 * len(orders), -largest),
            upper=np.full(2 * len(orders), largest),
            law=None if len(orders) == 1 else TWO_HARMONICS,
        )

    return Family(
        effect=DESCRIPTION.name,
        joint=joint,
        members=(member({}),),
        parameters=_parameters,
        member=member,
        richer=lambda plain: (member({**plain.shape, HARMONICS: 2.0}),),
    )


def _columns(run: Logged, joint: int, orders: Sequence[int]) -> Array:
    """Added torque for a unit of a and of b of each order, (N, n, 2 o)."""
    q, dq, ddq = run.q[:, joint], run.dq[:, joint], run.ddq[:, joint]
    own = run.table[joint]
    columns = np.empty((run.samples, run.joints, 2 * len(orders)))
    for at, order in enumerate(orders):
        cosine, sine = np.cos(order * q), np.sin(order * q)
        for index, (value, slope) in enumerate(
            ((cosine, -order * sine), (sine, order * cosine)), start=2 * at
        ):
            back = -np.column_stack([value, slope * dq, slope * ddq - order**2 * value * dq**2])
            columns[:, :, index] = run.load_change(joint, back)
            columns[:, joint, index] += own[VISCOUS] * back[:, 1] + own[ARMATURE] * back[:, 2]
    return columns


def _parameters(member: Member, c: Array, covariance: Array) -> dict[str, Quantity]:
    return wave_parameters(c, covariance, "rad")


def write(spec: Any, robot: Robot, injection: Injection) -> tuple[str, ...]:
    """There is no form."""
    return (
        "not in the model: MuJoCo's joint sensor reads the joint itself, and no field makes its error vary "
        "with the angle",
    )
