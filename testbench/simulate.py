"""The job behind ``simulate``: a model and a trajectory file in, a robot-log out."""

import dataclasses
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from identification.errors import InputError

from .effects import parse_injection
from .excitation_file import read_trajectory
from .files import require_writable
from .log import Recording, write_log
from .model_reading.reading import Choice
from .progress import steps
from .robot import load_robot, print_notes
from .simulation import SimulationOptions, controller_gains, held_up, sample_reference, simulate, tracking

# Share of the torque limit.
TORQUE_NOISE = 0.01


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
    trajectory's joints are the robot's where it names none. noisy: white noise of TORQUE_NOISE on the torque
    of joints that have a torque limit, in place of that of ``options``. A loop that ran away leaves no file.
    """
    require_writable(out, model, trajectory)
    joint_names, motion = read_trajectory(trajectory)
    robot = load_robot(model, choice, joint_names)
    print_notes(robot)
    if joint_names != robot.joint_names:
        expected = f"the model's joints {', '.join(robot.joint_names)}"
        raise InputError(trajectory, "joint_names", expected, ", ".join(joint_names))
    if noisy:
        noise = np.where(np.isfinite(robot.limits.torque), TORQUE_NOISE, 0.0)
        options = dataclasses.replace(
            options, sensors=dataclasses.replace(options.sensors, torque_noise=noise)
        )
    injections = tuple(parse_injection(robot, text) for text in effects)
    options = dataclasses.replace(options, effects=options.effects + injections)
    options, faster = held_up(options, robot)
    reference = sample_reference(motion, options.controller.rate, periods)
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
    if faster:
        print(faster)
    for line in (*gains.reduced(options.controller.bandwidth, robot.joint_names), *followed.warnings()):
        print(line)
    return recording
