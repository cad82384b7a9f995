"""Recordings on a uniform grid: resampled only where time stamps stray from it."""

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from identification.signals import Motion

from .log import Recording, with_channels
from .time_stamps import as_sampled

Array = NDArray[np.float64]

# Time stamps that stray further from the grid than this share of a step are on none.
GRID_TOLERANCE = 0.01
# What is differentiated later needs a curve between its samples; lines do for the rest.
SMOOTH = ("position", "reference_position")


def is_on_grid(time: Array, rate: float) -> bool:
    """Whether time stamps (N,) s keep to a grid of this rate, Hz, from the first one on."""
    grid = time[0] + np.arange(len(time)) / rate
    return bool(np.max(np.abs(time - grid)) <= GRID_TOLERANCE / rate)


def on_grid(recording: Recording) -> Recording:
    """The recording at its sample rate from its first time stamp on, every channel with it."""
    rate = recording.sample_rate
    if is_on_grid(recording.time, rate):
        return recording
    recording = as_sampled(recording)
    if is_on_grid(recording.time, rate):
        return recording
    # Steps of an arange drift where time is counted from 1970.
    grid = recording.time[0] + np.arange(round((recording.time[-1] - recording.time[0]) * rate)) / rate
    return with_channels(
        recording, grid, lambda field, own: interpolated(recording.time, own, grid, field in SMOOTH)
    )


def interpolated(time: Array, values: Array, instants: Array, is_smooth: bool) -> Array:
    """Values (N, n) taken at these times (N,) at other instants (M,), (M, n): by a curve, or by lines."""
    if is_smooth:
        return CubicSpline(time, values)(instants)
    return np.column_stack([np.interp(instants, time, column) for column in values.T])


def motion(recording: Recording) -> Motion:
    """The recording's position and torque on a uniform grid."""
    even = on_grid(recording)
    return Motion(even.position, even.torque, even.sample_rate)
