"""Actuator lag: the current loop of one drive follows its command late."""

from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from ..robot import Robot
from .action import (
    DRIVE,
    STEP,
    TIMESTEP,
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
from .mjcf_form import drive
from .signature import Family, Logged, Member, coefficients_as_named, single_joint

Array = NDArray[np.float64]

DESCRIPTION = EffectDescription(
    name="actuator_lag",
    title="Actuator lag",
    law="time_constant · d(true torque)/dt + true torque = reported torque; second_order: two such "
    "stages of half the time constant",
    reference='Leonhard, "Control of Electrical Drives", 3rd ed., 2001, ch. 7 (closed current loop as a lag)',
    scope=Scope.JOINT,
    parameters=(EffectParameter("time_constant", "s", 0.0, 0.1, (0.0003, 0.02)),),
    laws=("first_order", "second_order"),
    confused_with=("torque_delay", "joint_elasticity"),
)


def action(injection: Injection, simulated: SimulatedRobot) -> Action:
    """One or two first-order stages, exact for a torque command held over a physics step."""
    joint = require_joint(DESCRIPTION.name, injection.joint, simulated.robot.joints)
    stages = 2 if injection.law == "second_order" else 1
    time_constant = injection.values["time_constant"] / stages
    if time_constant == 0.0:
        return Action()
    return Action((hook(Stage.DRIVE, _lag, joint, (time_constant, stages), 2),))


@hook_kernel
def _lag(bus: int, parameters: int, state: int, joint: int) -> None:
    row = bus_row(bus, joint)
    time_constant, stages = vector(parameters, 2)
    torque = vector(state, 2)
    if row[STEP] == 0:
        torque[:] = row[DRIVE]
    x = row[TIMESTEP] / time_constant
    passed = -np.expm1(-x)
    for stage in range(int(stages)):
        behind = torque[stage] - row[DRIVE]
        torque[stage] -= passed * behind
        # What acts in a step is the stage's mean over it.
        row[DRIVE] += behind * passed / x


def signature(runs: Sequence[Logged], joint: int | None, into: int | None) -> Family:
    """reported = true + time_constant · d(true)/dt: the derivative of the predicted torque."""
    joint = require_joint(DESCRIPTION.name, joint, runs[0].joints)
    parameter = DESCRIPTION.parameters[0]
    member = Member(
        shape={},
        rows=(joint,),
        columns=single_joint([run.predicted_rate[:, [joint]] for run in runs]),
        lower=np.array([parameter.lower]),
        upper=np.array([parameter.upper]),
    )
    named = coefficients_as_named(DESCRIPTION, ("time_constant",))
    return Family(DESCRIPTION.name, joint, (member,), named)


def write(spec: Any, robot: Robot, injection: Injection) -> tuple[str, ...]:
    """The motor's activation as an exact first-order filter."""
    motor = drive(spec, robot, require_joint(DESCRIPTION.name, injection.joint, robot.joints))
    if injection.values["time_constant"] == 0:
        return ()
    motor.dyntype = mujoco.mjtDyn.mjDYN_FILTEREXACT
    motor.dynprm[0] = injection.values["time_constant"]
    sentences = ["the activation starts at zero: set it to the torque that holds the arm"]
    if injection.law == "second_order":
        sentences.append("a motor has one activation: one stage of the whole time constant stands for both")
    return tuple(sentences)
