"""The job behind ``simulate``: a model and a trajectory file in, a robot-log out."""

import dataclasses
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from identification.errors import InputError
from identification.excitation.trajectory import Trajectory
from identification.inverse_dynamics import inverse_dynamics

from ..effects import parse_injection
from ..excitation_file import read_trajectory
from ..files import require_writable
from ..log import Recording, write_log
from ..model_reading.reading import Choice
from ..progress import steps
from ..robot import Robot, load_robot, print_notes
from ..simulation import (
    ControllerOptions,
    Reference,
    SensorOptions,
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

    choice: of the model; the trajectory's joints are the robot's where it names none. Everything else as of
    ``simulate_along``. A loop that ran away leaves no file.
    """
    require_writable(out, model, trajectory)
    joint_names, motion = read_trajectory(trajectory)
    robot = load_robot(model, choice, joint_names)
    print_notes(robot)
    _require_joints(robot, joint_names, trajectory)
    recording, lines = simulate_along(robot, motion, trajectory, periods, options, effects, seed, jobs, noisy)
    out.parent.mkdir(parents=True, exist_ok=True)
    write_log(recording, out)
    joints, rate = len(recording.joint_names), recording.sample_rate
    print(f"{out}: {len(recording.time) / rate:.3g} s of {joints} joints at {rate:g} Hz")
    for line in lines:
        print(line)
    return recording


def motion_for(robot: Robot, path: Path) -> Trajectory:
    """The motion of a trajectory file. Raises InputError where it is not of the robot's joints."""
    joint_names, motion = read_trajectory(path)
    _require_joints(robot, joint_names, path)
    return motion


def _require_joints(robot: Robot, joint_names: tuple[str, ...], path: Path) -> None:
    if joint_names != robot.joint_names:
        expected = f"the model's joints {', '.join(robot.joint_names)}"
        raise InputError(path, "joint_names", expected, ", ".join(joint_names))


def options_of(
    controller: str = "pd_with_model_feedforward",
    bandwidth: float = 6.0,
    encoder_bits: int = 17,
    torque_noise: float | None = None,
) -> SimulationOptions:
    """How a run is simulated.

    controller: pd, pd_with_model_feedforward or model. bandwidth: Hz, of the position loop. encoder_bits:
    2**bits counts a turn, 0 for an exact encoder. torque_noise: share of the limit, or None.
    """
    return SimulationOptions(
        controller=ControllerOptions(kind=controller, bandwidth=bandwidth),
        sensors=SensorOptions(
            encoder_bits=encoder_bits,
            slide_resolution=1e-6 if encoder_bits else 0.0,
            torque_noise=0.0 if torque_noise is None else torque_noise,
        ),
        physics_timestep=2e-4,
    )


def simulate_along(
    robot: Robot,
    motion: Trajectory,
    source: Path,
    periods: int,
    options: SimulationOptions,
    effects: Sequence[str],
    seed: int,
    jobs: int | None,
    noisy: bool,
) -> tuple[Recording, tuple[str, ...]]:
    """The log of a robot driven along a motion, and lines on its loop and its noise.

    source: the motion's file, which errors name. effects: as ``NAME[:joint[:key=value,...]]``, beside those
    of ``options``. noisy: with the noise of ``torque_noise``, in place of that of ``options``. Raises
    InputError, for a loop that ran away too.
    """
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
    followed.require_followed(source)
    origin = {"trajectory": source.name}
    recording = dataclasses.replace(recording, provenance=recording.provenance | origin)
    slower = controller_gains(options, robot).reduced(options.controller.bandwidth, robot.joint_names)
    return recording, (*notes, *slower, *followed.warnings())


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
