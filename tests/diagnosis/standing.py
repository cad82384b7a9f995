"""Runs of an arm that stands between its moves."""

from itertools import pairwise

import numpy as np

from testbench.log import Recording
from testbench.robot import Robot
from testbench.simulation import SimulationOptions, simulate
from testbench.simulation.reference import Reference

from ..diagnosed import RATE

RUNS, MOVE, STAND, MOVES, SEED = 3, 0.7, 0.6, 8, 8


def standing_runs(robot: Robot, options: SimulationOptions) -> dict[str, Recording]:
    """Moves of least jerk from one random place to another, with a stand after each."""
    rng, references = np.random.default_rng(SEED), []
    for _ in range(RUNS):
        places = rng.uniform(-1.0, 1.0, (MOVES + 1, robot.joints))
        moves = [move(start, end) for start, end in pairwise(places)]
        references.append(Reference(*(np.concatenate(each) for each in zip(*moves, strict=True))))
    return {f"run_{k + 1}": run for k, run in enumerate(simulate(robot, references, options, seed=SEED))}


def move(start: np.ndarray, end: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Position, velocity and acceleration (N, n) of a move and the stand after it."""
    s = np.clip(np.arange(round((MOVE + STAND) * RATE)) / (MOVE * RATE), 0.0, 1.0)[:, None]
    path = s**3 * (10 - 15 * s + 6 * s**2)
    speed = 30 * s**2 * (1 - s) ** 2 / MOVE
    acceleration = 60 * s * (1 - s) * (1 - 2 * s) / MOVE**2
    return start + (end - start) * path, (end - start) * speed, (end - start) * acceleration
