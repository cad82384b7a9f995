"""Time stamps as they come: sorted where publishers interleave, merged where one sample was sent twice."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identification.errors import InputError

from .table import Numbers

Array = NDArray[np.float64]

# A message is late by fewer than so many usual steps where publishers interleave; more, and the clock was
# set.
INTERLEAVED = 20.0
# Stamps are coarser than the samples where so many of them are another sample's as well.
COARSE = 0.2
# Stamps on a coarse clock are of even samples where they stray from even ones by fewer than so many of its
# ticks.
TICKS = 2.0


@dataclass(frozen=True)
class Sampled:
    """Which rows of a stream are samples, in order, and when. rows: (M,) indices. time: (M,) s, from the
    first row.

    start: the first stamp, in the file's unit of so many seconds. notes: what was done, in words.
    """

    rows: NDArray[np.int64]
    time: Array
    start: int | float
    seconds: float
    notes: tuple[str, ...]


def sampled(stamps: Numbers, seconds: float, values: Numbers, source: object, clock: str) -> Sampled:
    """The samples of a stream by its stamps (N,), one of which is so many seconds.

    values: (N, k) by which repeated samples are known. Raises InputError for a clock that went back, or
    stood.
    """
    rows = np.arange(len(stamps))
    notes = []
    if stamps.dtype.kind == "f":
        rows = np.flatnonzero(np.isfinite(stamps))
        if len(rows) < len(stamps):
            notes.append(f"{len(stamps) - len(rows)} samples without a time stamp left out")
    if len(rows) < 2:
        raise InputError(source, clock, "time stamps", "fewer than two")
    # Differences first: in nanoseconds since 1970 a float would lose digits.
    start = stamps[rows[0]]
    time = (stamps[rows] - start).astype(np.float64) * seconds
    back = int(np.sum(np.diff(time) < 0))
    if back:
        _require_interleaved(time, rows, source, clock)
        order = np.argsort(time, kind="stable")
        rows, time = rows[order], time[order]
        notes.append(f"{back} time stamps step back by little, as where publishers interleave: sorted")
    rows, time, merged = _distinct(rows, time, values, source, clock)
    return Sampled(rows, time, start.item(), seconds, (*notes, *merged))


def later(one: Sampled, other: Sampled) -> float:
    """Seconds by which the first stamp of one stream is later than that of another."""
    # Subtracted first: in seconds since 1970 a float would lose digits.
    return (one.start - other.start) * one.seconds


def _require_interleaved(time: Array, rows: NDArray[np.int64], source: object, clock: str) -> None:
    """Raise InputError unless stamps that step back are late by a few samples only."""
    late = np.maximum.accumulate(time) - time
    steps = np.abs(np.diff(time))
    usual = float(np.median(steps[steps > 0]))
    if late.max() > INTERLEAVED * usual:
        at = int(np.argmax(np.diff(time) < -INTERLEAVED * usual)) + 1
        got = f"a step back of {time[at - 1] - time[at]:.4g} s at sample {rows[at] + 1} of the file"
        expected = "a clock that goes on; where these are two runs, cut the file there"
        raise InputError(source, clock, expected, got)


def _distinct(
    rows: NDArray[np.int64], time: Array, values: Numbers, source: object, clock: str
) -> tuple[NDArray[np.int64], Array, list[str]]:
    """Samples with stamps that increase: repeated samples once, those of a coarse clock spread evenly."""
    again = np.concatenate([[False], np.diff(time) <= 0])
    if not again.any():
        return rows, time, []
    same = np.concatenate([[False], np.all(_equal(values[rows[1:]], values[rows[:-1]]), axis=1)])
    notes = []
    if np.any(again & same):
        notes.append(f"{int(np.sum(again & same))} samples repeat the one before, stamp and all: left out")
        kept = ~(again & same)
        rows, time = rows[kept], time[kept]
        again = np.concatenate([[False], np.diff(time) <= 0])
    if len(rows) < 2:
        raise InputError(source, clock, "samples that differ", "one sample, again and again")
    if not again.any():
        return rows, time, notes
    if np.mean(again) < COARSE:
        notes.append(
            f"{int(again.sum())} samples have the stamp of the one before, but other values: left out"
        )
        return rows[~again], time[~again], notes
    ticks = np.diff(time)
    even = np.linspace(time[0], time[-1], len(time))
    if not np.any(ticks > 0) or np.max(np.abs(even - time)) > TICKS * np.median(ticks[ticks > 0]):
        got = f"{int(again.sum())} of {len(again)} stamps that are those of the sample before"
        raise InputError(source, clock, "a time stamp for each sample", got)
    notes.append("time stamps are coarser than the samples: spread evenly")
    return rows, even, notes


def _equal(one: Numbers, other: Numbers) -> NDArray[np.bool_]:
    both_lack = np.isnan(one) & np.isnan(other)
    return np.asarray((one == other) | both_lack)
