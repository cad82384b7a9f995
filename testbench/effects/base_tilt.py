"""Base tilt: the arm does not stand as upright as its model."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..robot import Robot
from .action import Action, SimulatedRobot
from .base import EffectDescription, EffectParameter, Injection, Scope
from .columns import ColumnsByInstant
from .experiment import Experiment
from .signature import Family, Logged, Member, coefficients_as_named

Array = NDArray[np.float64]

DESCRIPTION = EffectDescription(
    name="base_tilt",
    title="Base tilt",
    law="gravity in the base frame = (Ry(pitch) Rx(roll))' g",
    reference='Khalil & Dombre, "Modeling, Identification and Control of Robots", 2004, ch. 9 and 11',
    scope=Scope.ROBOT,
    parameters=(
        EffectParameter("roll", "rad", -0.5, 0.5, (0.002, 0.05)),
        EffectParameter("pitch", "rad", -0.5, 0.5, (0.002, 0.05)),
    ),
    confused_with=("encoder_offset", "cable_spring", "gravity_spring"),
    shown_by=(Experiment.WHOLE_RANGE,),
    relinearised=True,
    loads=True,
    sizes=("roll", "pitch"),
)


# Share of the other turn's torque.
ROUNDING = 1e-9


def tilted_gravity(gravity: Array, values: dict[str, float]) -> Array:
    """Gravity (3,) m/s² in the frame of a base that was turned about world x by roll, then y by pitch."""
    sine_r, cosine_r = np.sin(values["roll"]), np.cos(values["roll"])
    sine_p, cosine_p = np.sin(values["pitch"]), np.cos(values["pitch"])
    about_x = np.array([[1, 0, 0], [0, cosine_r, -sine_r], [0, sine_r, cosine_r]])
    about_y = np.array([[cosine_p, 0, sine_p], [0, 1, 0], [-sine_p, 0, cosine_p]])
    return (about_y @ about_x).T @ gravity


def action(injection: Injection, simulated: SimulatedRobot) -> Action:
    """The plant's gravity turned."""

    def tilt(plant: Any) -> None:
        plant.opt.gravity[:] = tilted_gravity(np.array(plant.opt.gravity), injection.values)

    return Action(change_plant=tilt)


def signature(runs: Sequence[Logged], joint: int | None, into: int | None) -> Family:
    """The gravity torques of the two gravity vectors that a small roll and pitch add.

    A turn that no joint feels, as about an axis that all axes are parallel to, is held at zero.
    """
    largest = ColumnsByInstant(runs, _columns).largest()
    felt = largest > ROUNDING * largest.max()
    member = Member(
        shape={},
        rows=tuple(range(runs[0].joints)),
        columns=ColumnsByInstant(runs, lambda run: _columns(run) * felt),
        lower=np.where(felt, [parameter.lower for parameter in DESCRIPTION.parameters], 0.0),
        upper=np.where(felt, [parameter.upper for parameter in DESCRIPTION.parameters], 0.0),
        widths=np.array([parameter.typical[1] for parameter in DESCRIPTION.parameters]),
    )
    named = coefficients_as_named(DESCRIPTION, ("roll", "pitch"))
    return Family(DESCRIPTION.name, None, (member,), named)


def _columns(run: Logged) -> Array:
    """Added torque for a radian of roll and of pitch, (N, n, 2)."""
    columns = np.empty((run.samples, run.joints, 2))
    for index, axis in enumerate(np.eye(3)[:2]):
        # The derivative of R' g at no rotation is g x axis.
        chain = replace(run.chain, gravity=np.cross(run.chain.gravity, axis))
        columns[:, :, index] = replace(run, chain=chain).gravity_load
    return columns


def write(spec: Any, robot: Robot, injection: Injection) -> tuple[str, ...]:
    """The model's gravity: the base stays, the world is turned under it."""
    spec.option.gravity = tilted_gravity(np.array(spec.option.gravity), injection.values)
    return ()
