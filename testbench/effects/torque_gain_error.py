"""Torque gain error: the drive gives another torque than it reports."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..robot import Robot
from .action import DRIVE, Action, SimulatedRobot, Stage, bus_row, hook, hook_kernel, require_joint, vector
from .base import EffectDescription, EffectParameter, Injection, Scope
from .columns import on_one_joint
from .experiment import Experiment
from .mjcf_form import drive
from .signature import Family, Logged, Member, Quantity

Array = NDArray[np.float64]

DESCRIPTION = EffectDescription(
    name="torque_gain_error",
    title="Torque gain error",
    law="true torque = (1 + relative) · reported torque",
    reference='Gautier & Briot, "Global identification of joint drive gains and dynamic parameters of '
    'robots", ASME J. Dyn. Sys., Meas., Control 136(5), 2014',
    scope=Scope.JOINT,
    parameters=(EffectParameter("relative", "-", -0.5, 0.5, (0.02, 0.15)),),
    confused_with=("payload", "torque_saturation"),
    shown_by=(Experiment.KNOWN_LOAD,),
    relinearised=True,
    of_friction=True,
    # Torque constants are known to two per cent or so, those of the joints beside it too: what is one joint's
    # gain to the model is their difference.
    healthy=2.2,
)


def action(injection: Injection, simulated: SimulatedRobot) -> Action:
    """The drive's torque times 1 + relative."""
    joint = require_joint(DESCRIPTION.name, injection.joint, simulated.robot.joints)
    gain = 1.0 + injection.values["relative"]
    return Action((hook(Stage.DRIVE, _gain, joint, gain),))


@hook_kernel
def _gain(bus: int, parameters: int, state: int, joint: int) -> None:
    bus_row(bus, joint)[DRIVE] *= vector(parameters, 1)[0]


def signature(runs: Sequence[Logged], joint: int | None, into: int | None) -> Family:
    """reported = true / (1 + relative): the predicted torque itself, with c = 1 / (1 + relative) - 1."""
    joint = require_joint(DESCRIPTION.name, joint, runs[0].joints)
    parameter = DESCRIPTION.parameters[0]
    member = Member(
        shape={},
        rows=(joint,),
        columns=on_one_joint(runs, lambda run: run.predicted[:, [joint]]),
        lower=np.array([1 / (1 + parameter.upper) - 1]),
        upper=np.array([1 / (1 + parameter.lower) - 1]),
        widths=np.array([parameter.typical[1]]),
    )
    return Family(DESCRIPTION.name, joint, (member,), _parameters, swallowed=True)


def _parameters(member: Member, c: Array, covariance: Array) -> dict[str, Quantity]:
    reported_share = 1.0 + float(c[0])
    std = float(np.sqrt(covariance[0, 0])) / reported_share**2
    return {"relative": Quantity(1 / reported_share - 1, std, "-")}


def write(spec: Any, robot: Robot, injection: Injection) -> tuple[str, ...]:
    """The motor's gain."""
    motor = drive(spec, robot, require_joint(DESCRIPTION.name, injection.joint, robot.joints))
    motor.gainprm[0] *= 1.0 + injection.values["relative"]
    return ()
