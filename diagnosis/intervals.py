"""Intervals of RMS errors: blocks of time drawn anew (Künsch, Annals of Statistics 17, 1989)."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from .preparation import Prepared

Array = NDArray[np.float64]

# s; longer than residuals remember.
BLOCK_SECONDS = 0.5
DRAWS, LOW, HIGH = 200, 0.05, 0.95


def rms_interval(prepared: Prepared, residual: Sequence[Array]) -> Array:
    """90 % interval (2, n) N·m of each joint's RMS residual over all runs; residual: a run, (M, n)."""
    squares, counts = [], []
    for run, values in zip(prepared.runs, residual, strict=True):
        block = ((run.time - run.time[0]) / BLOCK_SECONDS).astype(int)
        sums = np.zeros((block[-1] + 1, prepared.joints))
        used = np.zeros_like(sums)
        np.add.at(sums, block, np.where(run.used, values, 0.0) ** 2)
        np.add.at(used, block, run.used)
        squares.append(sums)
        counts.append(used)
    square, count = np.concatenate(squares), np.concatenate(counts)
    draws = np.random.default_rng(0).integers(0, len(square), (DRAWS, len(square)))
    drawn = np.sqrt(square[draws].sum(axis=1) / np.maximum(count[draws].sum(axis=1), 1))
    return np.quantile(drawn, [LOW, HIGH], axis=0)
