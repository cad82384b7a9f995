"""Torque saturation: the drive gives at most a limit, and reports what it was asked for."""

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..robot import Robot
from .action import DRIVE, Action, SimulatedRobot, Stage, bus_row, hook, hook_kernel, require_joint, vector
from .base import EffectDescription, EffectParameter, Injection, Scope
from .columns import on_one_joint
from .experiment import Experiment
from .mjcf_form import drive
from .signature import Family, Logged, Member, Quantity, grid_family

Array = NDArray[np.float64]

DESCRIPTION = EffectDescription(
    name="torque_saturation",
    title="Torque saturation",
    law="true torque = reported torque clipped to ± limit; soft: reported / (1 + |reported / limit|^8)^(1/8)",
    reference='Kapasouris, Athans & Stein, "Design of feedback control systems for stable plants with '
    'saturating actuators", CDC 1988',
    scope=Scope.JOINT,
    parameters=(EffectParameter("limit", "N·m", 1e-3, np.inf, (0.4, 0.8), "torque_limit"),),
    laws=("clip", "soft"),
    confused_with=("external_contact", "torque_gain_error"),
    shown_by=(Experiment.ONCE_MORE,),
    at_times=True,
    # A limit that clips is one, however far from the drive's rating.
    healthy=0.0,
)

# The knee of the soft law; the higher, the sharper.
SHARPNESS = 8
# Shares of the largest torque asked for; above the last one too little is clipped to be seen.
SHARES = (0.5, 0.6, 0.7, 0.8, 0.87, 0.93, 0.97)
# The law has no free factor; c only shows how well it holds.
FACTOR = (0.99, 1.01)


def action(injection: Injection, simulated: SimulatedRobot) -> Action:
    """The drive's torque clipped."""
    joint = require_joint(DESCRIPTION.name, injection.joint, simulated.robot.joints)
    kernel = _soft if injection.law == "soft" else _clip
    return Action((hook(Stage.DRIVE, kernel, joint, injection.values["limit"]),))


@hook_kernel
def _clip(bus: int, parameters: int, state: int, joint: int) -> None:
    row, limit = bus_row(bus, joint), vector(parameters, 1)[0]
    row[DRIVE] = min(max(row[DRIVE], -limit), limit)


@hook_kernel
def _soft(bus: int, parameters: int, state: int, joint: int) -> None:
    row, limit = bus_row(bus, joint), vector(parameters, 1)[0]
    row[DRIVE] /= (1.0 + abs(row[DRIVE] / limit) ** SHARPNESS) ** (1.0 / SHARPNESS)


def signature(runs: Sequence[Logged], joint: int | None, into: int | None) -> Family:
    """The part of what was asked for beyond the limit, c = 1.

    What was asked for is the command where it was logged, else the reported torque, which is what the
    drive thinks it gave: with the factor held near 1 it only says which samples are clipped, and the
    model must explain the limit itself there.
    """
    joint = require_joint(DESCRIPTION.name, joint, runs[0].joints)
    peak = max(float(np.abs(_asked(run, joint)).max()) for run in runs)
    return grid_family(
        DESCRIPTION.name,
        joint,
        partial(_member, runs, joint),
        {"limit": [share * peak for share in SHARES]},
        _parameters,
    )


def _asked(run: Logged, joint: int) -> Array:
    torque = run.tau if run.torque_command is None else run.torque_command
    return torque[:, joint]


def _member(runs: Sequence[Logged], joint: int, shape: Mapping[str, float]) -> Member:
    limit = shape["limit"]

    def beyond(run: Logged) -> Array:
        asked = _asked(run, joint)
        return (asked - np.clip(asked, -limit, limit))[:, None]

    return Member(
        shape={"limit": limit},
        rows=(joint,),
        columns=on_one_joint(runs, beyond),
        lower=np.array(FACTOR[:1]),
        upper=np.array(FACTOR[1:]),
    )


def _parameters(member: Member, c: Array, covariance: Array) -> dict[str, Quantity]:
    std = float(np.sqrt(covariance[1, 1])) if len(covariance) > 1 else 0.0
    return {"limit": Quantity(member.shape["limit"], std, "N·m")}


def write(spec: Any, robot: Robot, injection: Injection) -> tuple[str, ...]:
    """The motor's force range."""
    motor = drive(spec, robot, require_joint(DESCRIPTION.name, injection.joint, robot.joints))
    limit = injection.values["limit"] / abs(motor.gear[0])
    if np.isfinite(limit):
        motor.forcerange = [-limit, limit]
    if injection.law == "soft":
        return ("MuJoCo clips sharply, without the knee",)
    return ()
