"""Time stamps that jitter though the samples were even, as where messages are stamped when they are read.

A sample that is put where it was not taken is off by speed times jitter, which differentiated twice is more
than all that an arm does. Where samples were taken as stamped, evenly spaced they would not be smooth.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from .log import Recording

Array = NDArray[np.float64]

# Evenly spaced, positions leave less than this share of what they leave as stamped, of squared distances from
# the cubics through their neighbours.
SMOOTHER = 0.5
# A clock that is off by less than this share of a step in a whole run is not off.
RATE_TOLERANCE = 0.01


def as_sampled(recording: Recording) -> Recording:
    """The recording with the stamps of a grid where its positions say that it was sampled so."""
    time = recording.time
    counts = [np.arange(len(time)), _whole_steps(time)]
    grids = [_nearest_grid(time, count, recording.sample_rate) for count in counts if count is not None]
    stamped = _roughness(time, recording.position)
    moving = stamped > 0
    if not moving.any():
        return recording

    def left(grid: Array) -> float:
        return float(np.mean(_roughness(grid, recording.position)[moving] / stamped[moving]))

    best = min(grids, key=left)
    return replace(recording, time=best) if left(best) < SMOOTHER else recording


def off_cubic(time: Array, values: Array) -> Array:
    """How far samples (N,) are from the cubic through two neighbours on either side; 0 for the outermost."""
    off = np.zeros_like(values)
    if len(values) < 5:
        return off
    shifts = (0, 1, 3, 4)
    count = len(values) - 4
    at = [time[shift : shift + count] - time[2:-2] for shift in shifts]
    inner = np.zeros(count)
    for own, shift in enumerate(shifts):
        weight = np.ones(count)
        for other in range(len(shifts)):
            if other != own:
                weight *= at[other] / (at[other] - at[own])
        inner += weight * values[shift : shift + count]
    off[2:-2] = np.abs(values[2:-2] - inner)
    return off


def _whole_steps(time: Array) -> NDArray[np.int64] | None:
    """Which sample of a grid each of these stamps (N,) may be, where some are missing; None for no grid."""
    steps = np.round(np.diff(time) / np.median(np.diff(time))).astype(np.int64)
    return None if np.any(steps < 1) else np.concatenate([[0], np.cumsum(steps)])


def _nearest_grid(time: Array, count: NDArray[np.int64], rate: float) -> Array:
    """Stamps of these samples (N,) of a grid, nearest to those given (N,) s: of the rate, Hz, if they may."""
    # About the middle, or time counted from 1970 would drown the steps.
    middle = count - count.mean()
    step = float(middle @ (time - time.mean()) / (middle @ middle))
    if abs(step * rate - 1) * len(time) < RATE_TOLERANCE:
        step = 1 / rate
    return np.asarray(time.mean() + step * middle)


def _roughness(time: Array, positions: Array) -> Array:
    """Mean squares (n,) of how far positions (N, n) are from their neighbours' cubics."""
    return np.array([float(np.mean(off_cubic(time, position) ** 2)) for position in positions.T])
