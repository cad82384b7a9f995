"""The job behind ``simulate``: a model and a trajectory file in, a robot-log out."""

import dataclasses
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from identification.errors import InputError
from identification.inverse_dynamics import inverse_dynamics

from .effects import parse_injection
from .excitation_file import read_trajectory
from .files import require_writable
from .log import Recording, write_log
from .model_reading.reading import Choice
from .progress import steps
from .robot import Robot, load_robot, print_notes
from .simulation import (
    Reference,
    SimulationOptions,
    controller_gains,
    held_up,
    sample_reference,
    simulate,
    tracking,
)

Array = NDArray[np.float64]

# Share of the torque limit.
TORQUE_NOISE = 0.01
# Share of its limit that some joint's torque reaches along a motion; else the limits only fill a field.
LEAST_USE = 0.01


def simulate_model(
    model: Path,
    trajectory: Path,
    out: Path,
    periods: int,
    options: SimulationOptions,
    effects: Sequence[str],
    seed: int,
    jobs: int | None,
    choice: Choice | None = None,
    noisy: bool = False,
) -> Recording:
    """Drive a model along a trajectory file, write the robot-log to ``out`` and say so. Raises InputError.

    effects: as ``NAME[:joint[:key=value,...]]``, beside those of ``options``. choice: of the model; the
    trajectory's joints are the robot's where it names none. noisy: that of ``torque_noise``, in place of that
    of ``options``. A loop that ran away leaves no file.
    """
    require_writable(out, model, trajectory)
    joint_names, motion = read_trajectory(trajectory)
    robot = load_robot(model, choice, joint_names)
    print_notes(robot)
    if joint_names != robot.joint_names:
        expected = f"the model's joints {', '.join(robot.joint_names)}"
        raise InputError(trajectory, "joint_names", expected, ", ".join(joint_names))
    injections = tuple(parse_injection(robot, text) for text in effects)
    options = dataclasses.replace(options, effects=options.effects + injections)
    options, faster = held_up(options, robot)
    reference = sample_reference(motion, options.controller.rate, periods)
    notes = [faster] if faster else []
    if noisy:
        noise, filled = torque_noise(robot, reference)
        notes += [filled] if filled else []
        sensors = dataclasses.replace(options.sensors, torque_noise=noise)
        options = dataclasses.replace(options, sensors=sensors)
    with steps() as progress, progress.step("simulate"):
        (recording,) = simulate(robot, [reference], options, seed=seed, threads=jobs)
    followed = tracking(recording, robot.limits.torque)
    followed.require_followed(trajectory)
    told = {"trajectory": trajectory.name}
    recording = dataclasses.replace(recording, provenance=recording.provenance | told)
    out.parent.mkdir(parents=True, exist_ok=True)
    write_log(recording, out)
    joints, rate = len(recording.joint_names), recording.sample_rate
    print(f"{out}: {len(recording.time) / rate:.3g} s of {joints} joints at {rate:g} Hz")
    gains = controller_gains(options, robot)
    for line in (
        *notes,
        *gains.reduced(options.controller.bandwidth, robot.joint_names),
        *followed.warnings(),
    ):
        print(line)
    return recording


def torque_noise(robot: Robot, reference: Reference) -> tuple[Array, str]:
    """White noise on each joint's torque, (n,) as shares of the limits; a line where that is unusual.

    It is TORQUE_NOISE, and 0 for a joint without a limit. Where no joint's torque along the reference reaches
    LEAST_USE of its limit, it is TORQUE_NOISE of the largest torque instead.
    """
    limit = robot.limits.torque
    rated = np.isfinite(limit)
    share = np.where(rated, TORQUE_NOISE, 0.0)
    motion = reference.position, reference.velocity, reference.acceleration
    peak = np.abs(inverse_dynamics(robot.chain, robot.parameters, *motion)).max(axis=0)
    if not np.any(rated) or np.any((peak > LEAST_USE * limit)[rated]):
        return share, ""
    largest = float(peak[rated].max())
    line = (
        f"torque noise {TORQUE_NOISE:.0%} of {largest:.3g} N·m, the motion's largest torque: limits from "
        f"{limit[rated].min():g} N·m up are no ratings of these drives"
    )
    return np.divide(share * largest, limit, out=np.zeros_like(share), where=rated), line
