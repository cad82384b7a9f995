"""The parallel filter as a decimating convolution: only the samples that are kept are computed.

The zero-phase Butterworth low-pass of ``identification.filtering`` is linear and time-invariant away
from a run's ends, so its response to an impulse says it all. Torque and every column of every
hypothesis pass the same taps, so what is cut off beyond them cancels out.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from identification.filtering import decimation_step, zero_phase_lowpass

Array = NDArray[np.float64]

# Reach of the taps to either side, in cut-off periods: beyond it the response is below 1e-3 of its peak.
REACH_PERIODS = 2.5


@dataclass(frozen=True)
class DecimatingFilter:
    """taps: (2 r + 1,), symmetric, of unit sum. step: kept samples are this far apart, the first at r."""

    taps: Array
    step: int

    @property
    def reach(self) -> int:
        """Samples needed to either side, r."""
        return len(self.taps) // 2

    def kept(self, samples: int) -> NDArray[np.int64]:
        """Indices of the samples that are kept of a run of N, (M,)."""
        return np.arange(self.reach, samples - self.reach, self.step)

    def __call__(self, columns: Array) -> Array:
        """Columns (N, ...) low-passed and decimated, (M, ...)."""
        flat = columns.reshape(len(columns), -1)
        out = np.zeros((len(self.kept(len(columns))), flat.shape[1]))
        # An event's columns are zero most of the time.
        begin, last = _extent(flat)
        if begin <= last:
            first = max(-(-(begin - 2 * self.reach) // self.step), 0)
            end = last // self.step + 1
            _convolve(flat[first * self.step :], self.taps, self.step, out[first:end])
        return out.reshape(-1, *columns.shape[1:])


def decimating_filters(sample_rate: float, cutoffs: Array, thinning: int = 1) -> tuple[DecimatingFilter, ...]:
    """One filter for each cut-off, Hz, that all keep the same samples; equal cut-offs share one.

    thinning: only every so-many-th of the samples that hold what was passed is kept.
    """
    step = thinning * decimation_step(sample_rate, float(np.max(cutoffs)))
    taps = {cutoff: decimating_filter(sample_rate, cutoff).taps for cutoff in set(cutoffs.tolist())}
    reach = max(len(each) // 2 for each in taps.values())
    made = {
        cutoff: DecimatingFilter(np.pad(each, reach - len(each) // 2), step) for cutoff, each in taps.items()
    }
    return tuple(made[cutoff] for cutoff in cutoffs.tolist())


def filtered(filters: Sequence[DecimatingFilter], columns: Array) -> Array:
    """Columns (N, r, ...), each of the r through its own filter of ``decimating_filters``, (M, r, ...)."""
    if all(each is filters[0] for each in filters):
        return filters[0](columns)
    return np.stack([each(columns[:, place]) for place, each in enumerate(filters)], axis=1)


def decimating_filter(sample_rate: float, cutoff: float) -> DecimatingFilter:
    """The filter of a sample rate and cut-off, Hz."""
    reach = int(np.ceil(REACH_PERIODS * sample_rate / cutoff))
    impulse = np.zeros((8 * reach + 1, 1))
    impulse[4 * reach] = 1.0
    response = zero_phase_lowpass(impulse, sample_rate, cutoff)[:, 0]
    taps = response[3 * reach : 5 * reach + 1]
    taps = (taps + taps[::-1]) / 2
    return DecimatingFilter(taps / taps.sum(), decimation_step(sample_rate, cutoff))


@njit("UniTuple(int64, 2)(float64[:, :])", cache=True, nogil=True, error_model="numpy")
def _extent(x: Array) -> tuple[int, int]:
    """The first and the last row that is not all zero; the last before the first where there is none."""
    first, last = 0, x.shape[0] - 1
    while first <= last and not np.any(x[first]):
        first += 1
    while last >= first and not np.any(x[last]):
        last -= 1
    return first, last


# A sum of taps may be taken in any order that vectorises; compiled once, it is the same order every time.
@njit(
    "void(float64[:, :], float64[::1], int64, float64[:, ::1])",
    cache=True,
    nogil=True,
    error_model="numpy",
    fastmath={"contract", "reassoc"},
)
def _convolve(x: Array, taps: Array, step: int, out: Array) -> None:
    """out[m, c] = sum_k taps[k] x[m step + k, c], a column at a time in a buffer of its own."""
    column = np.empty(x.shape[0])
    for c in range(x.shape[1]):
        for t in range(x.shape[0]):
            column[t] = x[t, c]
        for m in range(out.shape[0]):
            window = column[m * step : m * step + taps.size]
            total = 0.0
            for k in range(taps.size):
                total += taps[k] * window[k]
            out[m, c] = total
