"""Logs of position servos as runs to simulate, and what is wrong with them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from identification.errors import InputError
from identification.filtering import central_difference
from identification.inverse_dynamics import inverse_dynamics
from identification.output_error.servo_run import ServoRun
from recordings.checks.positions import require_plausible_motion
from recordings.door import Door, said
from recordings.joints import joints_of

from ..degrees import in_radians
from ..log import Recording, check_joints, in_model_order
from ..lost_samples import lost_samples, mended
from ..robot import Robot
from ..runs import run_names
from ..sampling import on_grid
from .stated import Jointed, Servo, StatedDrive, servo_of

Array = NDArray[np.float64]

# Torque by the law over torque that the model needs: beyond, a gain's unit is another one.
IMPLAUSIBLE = 10.0
# s
SHORTEST = 2.0


@dataclass(frozen=True)
class ServoLog:
    """One log: its recording on an even grid, the run to simulate, and its drives as stated."""

    path: Path
    recording: Recording
    run: ServoRun
    servo: Servo


def read_servo_logs(
    paths: Sequence[Path], robot: Robot, stated: StatedDrive | None, map_path: Path | None = None
) -> list[ServoLog]:
    """The logs as runs, in their order; what was guessed of other formats is printed. As ``servo_logs``."""
    recordings, lines = opened_motions(paths, robot, map_path)
    for line in lines:
        print(line)
    return servo_logs(dict(zip(run_names(paths), recordings, strict=True)), paths, robot, stated)


def opened_motions(
    paths: Sequence[Path], robot: Robot, map_path: Path | None = None
) -> tuple[list[Recording], list[str]]:
    """The recordings of these logs, in their order, and lines on what was guessed of other formats.

    Torque is not read, and NaN. Raises InputError for a robot whose joints follow others, and for a log whose
    joints are not the robot's.
    """
    if robot.chain.followers is not None:
        expected = "measured torque, where joints follow others"
        raise InputError(robot.path, "joints", expected, ", ".join(robot.chain.followers.names))
    door = Door(joints_of(robot.chain, robot.limits), map_path)
    opened = [door.log(path, with_torque=False) for path in paths]
    recordings = []
    for path, each in zip(paths, opened, strict=True):
        recording = in_model_order(each.recording, robot.joint_names)
        check_joints(recording, robot.joint_names, path)
        recordings.append(
            in_radians(replace(recording, torque=np.full_like(recording.position, np.nan)), robot)
        )
    return recordings, said(opened, robot.path)


def servo_logs(
    recordings: Mapping[str, Recording], paths: Sequence[Path], robot: Robot, stated: StatedDrive | None
) -> list[ServoLog]:
    """Recordings by name as runs to simulate, in their order; paths: their files, which errors name.

    Raises InputError for one without commands or gains, one whose command is the measurement, and gains whose
    torque is out of all proportion to the model.
    """
    logs = []
    for path, (name, recording) in zip(paths, recordings.items(), strict=True):
        check_joints(recording, robot.joint_names, path)
        require_plausible_motion(recording, robot.chain, robot.limits, path)
        logs.append(servo_log(path, recording, name, robot, stated))
    _require_plausible_gains(logs, robot)
    return logs


def servo_log(
    path: Path, recording: Recording, name: str, robot: Jointed, stated: StatedDrive | None
) -> ServoLog:
    """A recording as a run to simulate. Raises InputError for one without commands of its own, or gains."""
    if recording.reference_position is None:
        raise InputError(path, "reference/position", "the commanded positions", "none")
    for joint, own in enumerate(robot.joint_names):
        position = recording.position[:, joint]
        if np.ptp(position) > 0 and np.array_equal(position, recording.reference_position[:, joint]):
            expected = "a command that is not the measurement itself"
            raise InputError(path, "reference/position", expected, f"identical arrays of {own}")
    servo = servo_of(stated, recording, name, robot, path)
    silent = replace(recording, torque=np.zeros_like(recording.position))
    even = on_grid(mended(silent, lost_samples(silent)))
    assert even.reference_position is not None
    duration = len(even.time) / even.sample_rate
    if duration < SHORTEST:
        raise InputError(path, "time", f"at least {SHORTEST:g} s", f"{duration:.3g} s")
    run = ServoRun(
        name,
        np.ascontiguousarray(even.position),
        np.ascontiguousarray(even.reference_position),
        even.sample_rate,
        servo.kp,
        servo.kd,
    )
    return ServoLog(path, even, run, servo)


def _require_plausible_gains(logs: Sequence[ServoLog], robot: Robot) -> None:
    """Raise InputError where the drives' law gives far more, or far less, torque than the model needs."""
    for log in logs:
        position, velocity = log.run.smoothed
        acceleration = central_difference(velocity, log.run.rate)
        needed = rms(inverse_dynamics(robot.chain, robot.parameters, position, velocity, acceleration, 0.01))
        law = log.run.kp * (log.run.command - position) - log.run.kd * velocity
        given = rms(np.clip(law, -log.servo.limit, log.servo.limit))
        for joint, name in enumerate(robot.joint_names):
            ratio = given[joint] / max(needed[joint], 1e-12)
            if ratio > IMPLAUSIBLE or ratio < 1 / IMPLAUSIBLE:
                expected = (
                    "gains in N·m/rad at the joint: where they are the firmware's, --gain-factor says "
                    f"what one unit is (about {1 / ratio:.2g} by this model)"
                )
                torques = f"{given[joint]:.3g} N·m RMS where the model needs {needed[joint]:.3g}"
                got = f"{log.run.kp[joint]:g} at {name}, which gives {torques}"
                raise InputError(log.path, "kp", expected, got)


def rms(values: Array) -> Array:
    """Root mean square (n,) over the samples of values (N, n)."""
    return np.asarray(np.sqrt(np.mean(values**2, axis=0)))
