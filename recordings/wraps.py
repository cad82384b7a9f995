"""Positions of hinges that jump by a turn where a counter wraps."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

TURN = 2 * np.pi
# A wrap is a step so near to a turn, rad.
NEAR_A_TURN = 0.5


def turns(position: Array) -> Array:
    """Whole turns (N, n) to take off positions (N, n), rad, so that none jumps by one."""
    steps = np.diff(position, axis=0)
    jumps = np.where(np.abs(np.abs(steps) - TURN) < NEAR_A_TURN, np.sign(steps), 0.0)
    return np.concatenate([np.zeros_like(position[:1]), np.cumsum(jumps, axis=0)])


def unwrapped(position: Array) -> Array:
    """Positions (N, n), rad, made continuous."""
    return np.asarray(position - TURN * turns(position))
