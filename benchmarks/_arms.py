"""The arm and the motion that benchmarks share."""

from functools import cache
from pathlib import Path

import numpy as np

from identification.excitation.design import DesignOptions, random_excitation
from identification.excitation.trajectory import Trajectory
from testbench.robot import Robot, load_robot

ROOT = Path(__file__).parents[1]
MODEL = ROOT / "models" / "tx90.xml"


@cache
def tx90() -> Robot:
    """The simulated TX-90: 6 joints, 78 standard parameters, 52 base parameters."""
    return load_robot(MODEL)


@cache
def random_motion() -> Trajectory:
    """A random motion of 10 s that keeps the TX-90's limits."""
    robot = tx90()
    return random_excitation(robot.chain, robot.parameters, robot.limits, DesignOptions(seed=1)).trajectory


def random_states(samples: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """q, dq, ddq of the TX-90, each (samples, 6), uniform in its ranges and speeds and ± 20 rad/s²."""
    limits, rng = tx90().limits, np.random.default_rng(0)
    shape = (samples, tx90().joints)
    q = rng.uniform(limits.lower, limits.upper, shape)
    dq = rng.uniform(-limits.velocity, limits.velocity, shape)
    return q, dq, rng.uniform(-20, 20, shape)
