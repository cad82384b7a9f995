"""Simulated runs at 1 kHz with PD, exact Coulomb friction and sensor noise, against a Python mj_step loop."""

import os
from collections.abc import Callable

import mujoco
import numpy as np

from testbench.simulation import (
    ControllerOptions,
    Reference,
    SensorOptions,
    SimulationOptions,
    sample_reference,
    simulate,
)
from testbench.simulation.controller import feedforward, velocity_pole
from testbench.simulation.gains import gains
from testbench.simulation.plant import plant_model

from ._arms import random_motion, tx90
from ._report import Goal, Report
from ._timing import alternate

RATE, PERIODS, ROUNDS = 1000.0, 1, 7
BITS, NOISE = 17, 0.01
OPTIONS = SimulationOptions(
    controller=ControllerOptions(rate=RATE),
    sensors=SensorOptions(encoder_bits=BITS, torque_noise=NOISE),
    physics_timestep=1 / RATE,
)
# The physics step that scenarios use.
FINE = SimulationOptions(
    controller=OPTIONS.controller, sensors=OPTIONS.sensors, physics_timestep=1 / (5 * RATE)
)


def measure() -> Report:
    robot, cores = tx90(), os.cpu_count() or 1
    batch = 4 * cores
    reference = sample_reference(random_motion(), RATE, PERIODS)
    seconds = (reference.samples - 1) / RATE
    one, many = "ours, one run", f"ours, {batch} runs on {cores} cores"
    fine, loop = f"{many}, physics at 5 kHz", "Python mj_step loop, one run"
    runs = {loop: 1, one: 1, many: batch, fine: batch}
    rivals: dict[str, Callable[[], object]] = {
        loop: _python_loop(reference),
        one: lambda: simulate(robot, [reference], OPTIONS),
        many: lambda: simulate(robot, [reference] * batch, OPTIONS),
        fine: lambda: simulate(robot, [reference] * batch, FINE),
    }
    followed = (
        _largest_error(rivals[loop](), reference),
        _largest_error(simulate(robot, [reference], OPTIONS)[0].position, reference),
    )
    times = alternate(rivals, ROUNDS)
    factor = {name: seconds * count / times.median(name) for name, count in runs.items()}
    rows = tuple(
        (
            name,
            f"{times.median(name):.3f}",
            f"{factor[name]:.0f}",
            f"{times.speedup(loop, name) * runs[name]:.1f}",
        )
        for name in rivals
    )
    return Report(
        columns=("way", "s", "times real time", "times faster a run"),
        rows=rows,
        goals=(
            Goal("one run against the Python loop", times.speedup(loop, one), 2.5),
            Goal(f"times real time on all {cores} cores", factor[many], 300),
        ),
        notes=(
            f"TX-90, {seconds:g} s a run; ours from the reference to the finished recording, truth included.",
            "The Python loop has the same feedforward, gains, encoder, velocity filter and limits, by numpy.",
            "It does less than ours: Coulomb friction is a plain sgn without stiction, no truth is logged.",
            f"Largest tracking error: loop {followed[0]:.1e} rad, ours {followed[1]:.1e} rad.",
        ),
    )


def _largest_error(position: np.ndarray, reference: Reference) -> float:
    return float(np.abs(position - reference.position).max())


def _python_loop(reference: Reference) -> Callable[[], np.ndarray]:
    """The usual way: one mj_step a tick, everything else by numpy; returns the measured positions (N, n)."""
    robot = tx90()
    model, controller = robot.model, OPTIONS.controller
    limits, n = robot.limits, robot.joints
    plant = plant_model(model, 1 / RATE)
    viscous, coulomb = model.dof_damping.copy(), model.dof_frictionloss.copy()

    def loop() -> np.ndarray:
        found = gains(controller, robot.chain, robot.parameters, limits.lower, limits.upper)
        kp, kd = found.kp, found.kd
        forward = feedforward(robot.chain, robot.parameters, reference, controller.coulomb_smoothing)
        rng = np.random.default_rng(0)
        noise = NOISE * limits.torque * rng.standard_normal(reference.position.shape)
        quantum, pole = 2 * np.pi / 2**BITS, velocity_pole(controller)
        position, velocity, torque, true_velocity = (np.zeros(reference.position.shape) for _ in range(4))
        data = mujoco.MjData(plant)
        data.qpos[:] = reference.position[0]
        last, speed = reference.position[0], np.zeros(n)
        for k in range(reference.samples):
            reading = quantum * np.rint(data.qpos / quantum)
            speed = pole * speed + (1 - pole) * (reading - last) * RATE
            last = reading
            command = (
                forward[k] + kp * (reference.position[k] - reading) + kd * (reference.velocity[k] - speed)
            )
            command = np.minimum(np.maximum(command, -limits.torque), limits.torque)
            position[k], velocity[k], true_velocity[k] = reading, speed, data.qvel
            torque[k] = command + noise[k]
            data.qfrc_applied[:] = command - viscous * data.qvel - coulomb * np.sign(data.qvel)
            mujoco.mj_step(plant, data)
        return position

    return loop
