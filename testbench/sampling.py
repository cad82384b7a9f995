"""Recordings on a uniform grid: resampled only where time stamps stray from it."""

from dataclasses import replace
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline

from identification.signals import Motion

from .log import CHANNELS, Recording

# Time stamps that stray further from the grid than this share of a step are resampled.
GRID_TOLERANCE = 0.01
# What is differentiated later needs a curve between its samples; lines do for the rest.
SMOOTH = ("position", "reference_position")


def on_grid(recording: Recording) -> Recording:
    """The recording at its sample rate from its first time stamp on, every channel with it."""
    rate, count = recording.sample_rate, len(recording.time)
    grid = recording.time[0] + np.arange(count) / rate
    if np.max(np.abs(recording.time - grid)) <= GRID_TOLERANCE / rate:
        return recording
    # Steps of an arange drift where time is counted from 1970.
    grid = recording.time[0] + np.arange(round((recording.time[-1] - recording.time[0]) * rate)) / rate
    channels: dict[str, Any] = {"time": grid}
    for _, field, _, _ in CHANNELS:
        values = getattr(recording, field)
        if values is None:
            continue
        if field in SMOOTH:
            channels[field] = CubicSpline(recording.time, values)(grid)
        else:
            channels[field] = np.column_stack(
                [np.interp(grid, recording.time, column) for column in values.T]
            )
    return replace(recording, **channels)


def motion(recording: Recording) -> Motion:
    """The recording's position and torque on a uniform grid."""
    even = on_grid(recording)
    return Motion(even.position, even.torque, even.sample_rate)
