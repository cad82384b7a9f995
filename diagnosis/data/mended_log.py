"""A log before it is filtered: on a grid, not too fast, with what was lost mended and torque in time."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from identification.signals import Motion
from testbench.log import Recording, with_channels
from testbench.lost_samples import lost_samples, mended
from testbench.sampling import motion, on_grid
from testbench.torque_lag import TorqueLag

Array = NDArray[np.float64]

# Hz; logs are not looked at faster, nor long ones than this, lest so many samples of all joints together fill
# the memory.
FAST, SLOWEST, MOST_LOGGED = 1000.0, 250.0, 2_000_000
# Of all that a torque moves; what is less is no step of it.
ROUNDING = 1e-9


@dataclass(frozen=True)
class MendedLog:
    """A log before it is filtered.

    name: the run's. recording: mended, thinned and on a grid; motion: its own. stamps: (S,) s of what was not
    lost. lost: how many samples were. torque_step, position_step: (n,) N·m and rad (m), that it counts in.
    """

    name: str
    recording: Recording
    motion: Motion
    stamps: Array
    lost: int
    torque_step: Array
    position_step: Array


def mended_log(name: str, recording: Recording, fast: float, lag: TorqueLag) -> MendedLog:
    """A run's recording, looked at this fast at most, Hz. lag: by which it has its torque late."""
    lost = lost_samples(recording)
    even = lag.taken_back(_thinned(on_grid(mended(recording, lost)), fast))
    steps = _step(recording.torque), _step(recording.position)
    return MendedLog(name, even, motion(even), recording.time[~lost], int(lost.sum()), *steps)


def rate_for(joints: int, seconds: float) -> float:
    """The sample rate that logs of so many joints, and so many seconds in all, are looked at, Hz."""
    return float(np.clip(MOST_LOGGED / (seconds * joints), SLOWEST, FAST))


def _thinned(recording: Recording, fast: float) -> Recording:
    """A fast log as means of neighbouring samples, at about so many Hz; the band in question is far below."""
    count = round(recording.sample_rate / fast)
    if count < 2:
        return recording

    def means(samples: Array) -> Array:
        whole = len(samples) // count * count
        return samples[:whole].reshape(-1, count, *samples.shape[1:]).mean(axis=1)

    slower = replace(recording, sample_rate=recording.sample_rate / count)
    return with_channels(slower, means(recording.time), lambda _, own: means(own))


def _step(values: Array) -> Array:
    """The smallest difference (n,) of two samples (N, n) in a row, rounding apart; 0 for none."""
    steps = np.abs(np.diff(values, axis=0))
    least = np.min(steps, axis=0, where=steps > ROUNDING * np.ptp(values, axis=0), initial=np.inf)
    return np.where(np.isfinite(least), least, 0.0)
