"""Slow samples of all runs, motion and torque alike low-passed: what conventions are judged by."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from identification.filtering import central_difference, edge_samples, zero_phase_lowpass
from testbench.log import Recording
from testbench.lost_samples import lost_samples, mended
from testbench.sampling import motion

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

# Hz: an encoder's noise, differentiated twice, is small below it, and arms move slower. As a share of the
# sample rate at most.
BAND, OF_RATE = 5.0, 0.2
# Samples kept of all runs together.
MOST = 320
# rad/s (m/s): the sign of a slower joint's friction is not known.
MOVING = 0.02


@dataclass(frozen=True)
class Samples:
    """M samples of n joints, SI units at the joint.

    time: (M,) s. q, dq, ddq, torque: (M, n). moves: (M, n) bool, faster than MOVING. run: (M,) which
    recording each is of.
    seconds: all that was recorded.
    """

    time: Array
    q: Array
    dq: Array
    ddq: Array
    torque: Array
    moves: Mask
    run: NDArray[np.int64]
    seconds: float


def slow_samples(recordings: Sequence[Recording], most: int = MOST) -> Samples | None:
    """Samples of these recordings, evenly spread; None where none is long enough for the filter."""
    parts = [part for index, each in enumerate(recordings) if (part := _slow(each, index)) is not None]
    if not parts:
        return None
    time, q, dq, ddq, torque, run = (np.concatenate(column) for column in zip(*parts, strict=True))
    every = slice(None, None, max(1, len(q) // most))
    time, q, dq, ddq, torque, run = (each[every] for each in (time, q, dq, ddq, torque, run))
    seconds = sum(float(each.time[-1] - each.time[0]) for each in recordings)
    return Samples(time, q, dq, ddq, torque, np.abs(dq) > MOVING, run, seconds)


def _slow(recording: Recording, index: int) -> tuple[NDArray[Any], ...] | None:
    even = motion(mended(recording, lost_samples(recording)))
    rate = even.sample_rate
    cutoff = min(BAND, OF_RATE * rate)
    edge = edge_samples(rate, cutoff)
    if len(even.position) < 4 * edge:
        return None
    q, torque = (zero_phase_lowpass(each, rate, cutoff) for each in (even.position, even.torque))
    dq = central_difference(q, rate)
    ddq = central_difference(dq, rate)
    kept = slice(edge, len(q) - edge, max(1, round(rate / (4 * cutoff))))
    time = np.arange(len(q)) / rate
    return time[kept], q[kept], dq[kept], ddq[kept], torque[kept], np.full(len(q[kept]), index)
