"""Encoder offset: a joint's zero is not where the model has it."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..robot import Robot
from .action import READING, Action, SimulatedRobot, Stage, bus_row, hook, hook_kernel, require_joint, vector
from .base import EffectDescription, EffectParameter, Injection, Scope
from .columns import by_run
from .experiment import Experiment
from .mjcf_form import file_angle, joint_element
from .signature import Family, Logged, Member, coefficients_as_named

Array = NDArray[np.float64]

DESCRIPTION = EffectDescription(
    name="encoder_offset",
    title="Encoder offset",
    law="measured position = true position + offset",
    reference='Mooring, Roth & Driels, "Fundamentals of Manipulator Calibration", Wiley 1991',
    scope=Scope.JOINT,
    parameters=(EffectParameter("offset", "rad", -0.5, 0.5, (0.0005, 0.05)),),
    confused_with=("encoder_eccentricity", "base_tilt", "gravity_spring", "payload"),
    shown_by=(Experiment.WHOLE_RANGE,),
    of_encoder=True,
    relinearised=True,
    loads=True,
    # Small errors of an encoder are what other imperfections of a loaded joint look like.
    healthy=15.0,
)

# A change over a known offset holds from it over this to this times it.
NEAR = 1.6


def action(injection: Injection, simulated: SimulatedRobot) -> Action:
    """The reading plus the offset."""
    joint = require_joint(DESCRIPTION.name, injection.joint, simulated.robot.joints)
    return Action((hook(Stage.ENCODER, _offset, joint, injection.values["offset"]),))


@hook_kernel
def _offset(bus: int, parameters: int, state: int, joint: int) -> None:
    bus_row(bus, joint)[READING] += vector(parameters, 1)[0]


def signature(runs: Sequence[Logged], joint: int | None, into: int | None) -> Family:
    """tau(measured - offset): less the derivative of the load by this joint's position, at all joints.

    Where that is known to lie far off, the change over what is known: exact there, and good near it.
    """
    joint = require_joint(DESCRIPTION.name, joint, runs[0].joints)
    parameter, known = DESCRIPTION.parameters[0], runs[0].zeros
    offset = 0.0 if known is None else float(known[joint])
    lower, upper = parameter.lower, parameter.upper
    if offset:
        lower, upper = sorted((offset / NEAR, offset * NEAR))

    def columns(run: Logged) -> Array:
        if offset:
            return (run.load_elsewhere(joint, -offset) / offset)[:, :, None]
        return run.load_change(joint, np.array([[-1.0, 0.0, 0.0]]))[:, :, None]

    member = Member(
        shape={},
        rows=tuple(range(runs[0].joints)),
        columns=by_run(runs, columns),
        lower=np.array([lower]),
        upper=np.array([upper]),
        # One that is known to lie far off is no longer judged by how far they are on arms in general.
        widths=None if offset else np.array([parameter.typical[1]]),
    )
    named = coefficients_as_named(DESCRIPTION, ("offset",))
    return Family(DESCRIPTION.name, joint, (member,), named, swallowed=True)


def write(spec: Any, robot: Robot, injection: Injection) -> tuple[str, ...]:
    """The joint's reference: its coordinate becomes what the encoder reads; limits and keyframes follow."""
    joint = require_joint(DESCRIPTION.name, injection.joint, robot.joints)
    element = joint_element(spec, robot, joint)
    offset = injection.values["offset"]
    turned = file_angle(spec, robot, joint, offset)
    element.ref += turned
    element.springref += turned
    if element.range[0] != element.range[1]:
        element.range = element.range + turned
    for key in spec.keys:
        if len(key.qpos):
            own = robot.chain.in_tree[joint]
            key.qpos = [value + offset * (index == own) for index, value in enumerate(key.qpos)]
    return ()
