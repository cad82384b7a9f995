"""Columns of effects at the full rate, of which only what is worked on is held: all of them fill a memory."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import overload

import numpy as np
from numpy.typing import NDArray

from .logged import Logged

Array = NDArray[np.float64]

# Samples whose columns are made at once where all of a run are not needed together.
AT_ONCE = 1 << 15


class ColumnsByRun(Sequence[Array]):
    """A member's columns, those of a run made whenever they are read, and kept by nobody.

    make: from a run's index, its columns (N, r, k). runs: how many.
    """

    def __init__(self, make: Callable[[int], Array], runs: int):
        self._make, self._runs = make, range(runs)

    @overload
    def __getitem__(self, run: int) -> Array: ...
    @overload
    def __getitem__(self, run: slice) -> Sequence[Array]: ...
    def __getitem__(self, run: int | slice) -> Array | Sequence[Array]:
        if isinstance(run, slice):
            return [self._make(each) for each in self._runs[run]]
        return self._make(self._runs[run])

    def __len__(self) -> int:
        return len(self._runs)


class ColumnsByInstant(ColumnsByRun):
    """The same where a sample's columns follow from that sample alone, so that parts of a run can be made.

    make: from a run, or a part of it, its columns.
    """

    def __init__(self, runs: Sequence[Logged], make: Callable[[Logged], Array]):
        super().__init__(lambda run: make(runs[run]), len(runs))
        self._logged, self._of = runs, make

    def of_part(self, run: int, samples: slice) -> Array:
        """Columns (m, r, k) of some samples of a run."""
        return self._of(self._logged[run].part(samples))

    def largest(self) -> Array:
        """The largest absolute value of each of the k columns, in all runs and rows, (k,)."""
        parts = (
            self.of_part(run, slice(first, first + AT_ONCE))
            for run, each in enumerate(self._logged)
            for first in range(0, each.samples, AT_ONCE)
        )
        return np.max([np.abs(part).max(axis=(0, 1)) for part in parts], axis=0)


def by_run(runs: Sequence[Logged], make: Callable[[Logged], Array]) -> ColumnsByRun:
    """Columns of which ``make`` makes those of a run, (N, r, k), whenever they are read."""
    return ColumnsByRun(lambda run: make(runs[run]), len(runs))


def on_one_joint(runs: Sequence[Logged], make: Callable[[Logged], Array]) -> ColumnsByRun:
    """The same of an effect on one joint's own torque, made as (N, k)."""
    return by_run(runs, lambda run: make(run)[:, None, :])


@dataclass(frozen=True)
class Window:
    """Columns that are zero but from a sample ``first`` on, and but for some of all, from ``column`` on.

    values: (m, r, k).
    """

    first: int
    column: int
    values: Array


@dataclass(frozen=True)
class WindowedColumns(Sequence[Array]):
    """An event's columns, kept as what of them is not zero; whole when they are read.

    windows: a run. samples: of each run. shape: r rows and k columns.
    """

    windows: tuple[tuple[Window, ...], ...]
    samples: tuple[int, ...]
    shape: tuple[int, int]

    @overload
    def __getitem__(self, run: int) -> Array: ...
    @overload
    def __getitem__(self, run: slice) -> Sequence[Array]: ...
    def __getitem__(self, run: int | slice) -> Array | Sequence[Array]:
        if isinstance(run, slice):
            return [self[each] for each in range(len(self))[run]]
        out = np.zeros((self.samples[run], *self.shape))
        for window in self.windows[run]:
            count, _, k = window.values.shape
            out[window.first : window.first + count, :, window.column : window.column + k] = window.values
        return out

    def __len__(self) -> int:
        return len(self.samples)


def over_all_joints(columns: Array, rows: Sequence[int], joints: int) -> Array:
    """Columns (N, r, k) at some joints over all, (N, joints, k); zero elsewhere."""
    out = np.zeros((len(columns), joints, columns.shape[2]))
    out[:, list(rows)] = columns
    return out
