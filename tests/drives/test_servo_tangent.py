"""Derivatives of the simulated position by the robot's table, against differences of simulations."""

import numpy as np
import pytest

from identification.output_error.plant import (
    BACK_EMF,
    COMMAND_STEP,
    DEADBAND,
    DELAY,
    EXTRA,
    FRICTION_CENTRE,
    FRICTION_SLOPE,
    KD_SCALE,
    KP_SCALE,
    LIMIT,
    LOAD_FRICTION,
    STALL,
    STRIBECK_VELOCITY,
    WIDTH,
)
from identification.output_error.servo_loop import Window, simulate
from identification.output_error.servo_tangent import is_smooth, tangent
from identification.parameters import ARMATURE, COULOMB, MASS, OFFSET, VISCOUS
from studies.drives.leg import KD, KP, command, table, written
from testbench.robot import Robot, load_robot

Array = np.ndarray

RATE = 100.0
# Joints that stick and slip, and load their gears.
ROUGH = {
    EXTRA: 0.1, STRIBECK_VELOCITY: 0.3, LOAD_FRICTION: 0.1, FRICTION_SLOPE: 0.2, FRICTION_CENTRE: 0.1,
}  # fmt: skip


@pytest.fixture(scope="module")
def robot(tmp_path_factory: pytest.TempPathFactory) -> Robot:
    return load_robot(written(tmp_path_factory.mktemp("leg")))


def _with(plant: Array, entries: dict[int, float]) -> Array:
    out = plant.copy()
    for column, value in entries.items():
        out[:, column] = value
    return out


def _direction(joint: int, column: int) -> Array:
    out = np.zeros((2, WIDTH))
    out[joint, column] = 1.0
    return out


@pytest.mark.parametrize(
    ("entries", "columns"),
    [
        ({}, (0, 3, 6, 8, MASS, ARMATURE, VISCOUS, COULOMB, OFFSET, KP_SCALE, KD_SCALE, DELAY)),
        (ROUGH, (*ROUGH, ARMATURE, COULOMB, DELAY)),
        ({LIMIT: 1.2}, (LIMIT, ARMATURE, KP_SCALE, KD_SCALE)),
        ({STALL: 3.0, BACK_EMF: 0.3}, (STALL, BACK_EMF, KP_SCALE, KD_SCALE, VISCOUS)),
        ({DEADBAND: 0.02}, (DEADBAND, KP_SCALE, COULOMB)),
    ],
)
def test_derivatives_are_those_of_differences(
    robot: Robot, entries: dict[int, float], columns: tuple[int, ...]
) -> None:
    plant = _with(table(robot.path), entries)
    follow = command(RATE, 4.0, 3)
    window = Window(follow, KP, KD, 50, 350, follow[50], np.zeros(2))
    directions = np.array([_direction(joint, column) for column in columns for joint in range(2)])
    assert is_smooth(plant, directions)
    run, found = tangent(robot.chain, plant, directions, window, RATE)
    step = 1e-8
    tables = np.stack([plant, *(plant + step * each for each in directions)])
    base, *moved = (run.position for (run,) in simulate(robot.chain, tables, [window], RATE))
    assert np.array_equal(run.position, base)
    for column, each in enumerate(moved):
        expected = (each - base) / step
        # Rounding of the simulation over the step.
        assert np.abs(found[..., column] - expected).max() < 1e-4 * np.abs(expected).max() + 1e-6


def test_a_run_that_ends_in_nan_has_derivatives_up_to_there(robot: Robot) -> None:
    impossible = table(robot.path)
    impossible[:, :10] *= -1
    follow = command(RATE, 1.0, 3)
    window = Window(follow, KP, KD, 0, 100, follow[0], np.zeros(2))
    run, found = tangent(robot.chain, impossible, np.array([_direction(0, ARMATURE)]), window, RATE)
    assert np.isnan(run.position[-1]).all()
    assert np.isnan(found[-1]).all()


def test_a_command_that_is_rounded_has_no_derivatives_that_are_carried_along(robot: Robot) -> None:
    plant, directions = table(robot.path), np.array([_direction(0, ARMATURE)])
    assert not is_smooth(_with(plant, {COMMAND_STEP: 0.01}), directions)
    assert not is_smooth(plant, np.array([_direction(1, COMMAND_STEP)]))
