"""The parallel filter as a decimating convolution: only the samples that are kept are computed.

The zero-phase Butterworth low-pass of ``identification.filtering`` is linear and time-invariant away
from a run's ends, so its response to an impulse says it all. Torque and every column of every
hypothesis pass the same taps, so what is cut off beyond them cancels out.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identification.compiled import njit
from identification.filtering import decimation_step, zero_phase_lowpass
from testbench.effects.columns import AT_ONCE, Window

Array = NDArray[np.float64]

# Reach of the taps to either side, in cut-off periods: beyond it the response is below 1e-3 of its peak.
REACH_PERIODS = 2.5


@dataclass(frozen=True)
class DecimatingFilter:
    """taps: (2 m + 1,), symmetric, of unit sum. step: kept samples are so far apart, the first at ``reach``.

    reach: samples needed to either side, m; of filters that keep the same samples, the largest m.
    """

    taps: Array
    step: int
    reach: int

    def kept(self, samples: int) -> NDArray[np.int64]:
        """Indices of the samples that are kept of a run of N, (M,)."""
        return np.arange(self.reach, samples - self.reach, self.step)

    def __call__(self, columns: Array) -> Array:
        """Columns (N, ...) low-passed and decimated, (M, ...)."""
        out = np.empty((len(self.kept(len(columns))), *columns.shape[1:]))
        self.into(columns, out)
        return out

    def into(self, columns: Array, out: Array) -> None:
        """The same, written to ``out``."""
        flat = columns.reshape(len(columns), -1)
        margin = self.reach - len(self.taps) // 2
        _convolve(flat[margin:], self.taps, self.step, out.reshape(len(out), flat.shape[1], copy=False))


def decimating_filters(sample_rate: float, cutoffs: Array, thinning: int = 1) -> tuple[DecimatingFilter, ...]:
    """One filter for each cut-off, Hz, that all keep the same samples; equal cut-offs share one.

    thinning: only every so-many-th of the samples that hold what was passed is kept.
    """
    step = thinning * decimation_step(sample_rate, float(np.max(cutoffs)))
    own = {cutoff: decimating_filter(sample_rate, cutoff) for cutoff in set(cutoffs.tolist())}
    reach = max(each.reach for each in own.values())
    made = {cutoff: DecimatingFilter(each.taps, step, reach) for cutoff, each in own.items()}
    return tuple(made[cutoff] for cutoff in cutoffs.tolist())


def parts(each: DecimatingFilter, samples: int, count: int = 0) -> Iterator[tuple[slice, slice]]:
    """A run of N samples in parts: the samples that are kept, and those that they are filtered of.

    count: so many are kept of a part; 0 for those of AT_ONCE samples.
    """
    kept, count = len(each.kept(samples)), count or max(AT_ONCE // each.step, 1)
    for first in range(0, kept, count):
        last = min(first + count, kept)
        yield slice(first, last), slice(first * each.step, (last - 1) * each.step + 2 * each.reach + 1)


def filtered_in_parts(
    filters: Sequence[DecimatingFilter], make: Callable[[slice], Array], samples: int, count: int
) -> Array:
    """The same as ``filtered``, (M, r, k), of k = ``count`` columns that are made a part at a time."""
    out = np.empty((len(filters[0].kept(samples)), len(filters), count))
    for kept, part in parts(filters[0], samples):
        out[kept] = filtered(filters, make(part))
    return out


def filtered(filters: Sequence[DecimatingFilter], columns: Array) -> Array:
    """Columns (N, r, ...), each of the r through its own filter of ``decimating_filters``, (M, r, ...)."""
    if all(each is filters[0] for each in filters):
        return filters[0](columns)
    out = np.empty((len(filters[0].kept(len(columns))), *columns.shape[1:]))
    for place, each in enumerate(filters):
        each.into(columns[:, place], out[:, place])
    return out


def filtered_windows(
    filters: Sequence[DecimatingFilter], windows: Sequence[Window], samples: int, count: int
) -> Array:
    """The same of columns that are zero but in some windows, (M, r, k): N samples, k = ``count``."""
    step, reach = filters[0].step, filters[0].reach
    kept = len(filters[0].kept(samples))
    out = np.zeros((kept, len(filters), count))
    for window in windows:
        length, _, k = window.values.shape
        # What is kept of the samples that its filter spreads it over.
        first = max(-(-(window.first - 2 * reach) // step), 0)
        end = min((window.first + length - 1) // step + 1, kept)
        if first >= end:
            continue
        around = np.zeros(((end - 1 - first) * step + 2 * reach + 1, len(filters), k))
        start = window.first - first * step
        inside = window.values[max(-start, 0) : max(len(around) - start, 0)]
        around[max(start, 0) :][: len(inside)] = inside
        out[first:end, :, window.column : window.column + k] = filtered(filters, around)
    return out


def decimating_filter(sample_rate: float, cutoff: float) -> DecimatingFilter:
    """The filter of a sample rate and cut-off, Hz."""
    reach = int(np.ceil(REACH_PERIODS * sample_rate / cutoff))
    impulse = np.zeros((8 * reach + 1, 1))
    impulse[4 * reach] = 1.0
    response = zero_phase_lowpass(impulse, sample_rate, cutoff)[:, 0]
    taps = response[3 * reach : 5 * reach + 1]
    taps = (taps + taps[::-1]) / 2
    return DecimatingFilter(taps / taps.sum(), decimation_step(sample_rate, cutoff), reach)


# A sum of taps may be taken in any order that vectorises; compiled once, it is the same order every time.
@njit(
    "void(float64[:, :], float64[::1], int64, float64[:, :])",
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
