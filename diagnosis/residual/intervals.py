"""Intervals of errors and shares: blocks of time drawn anew (Künsch, Annals of Statistics 17, 1989)."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from identification.statistics import SIGNIFICANCE

from ..data.run import Prepared, Run

Array = NDArray[np.float64]

# s; longer than residuals remember.
BLOCK_SECONDS = 0.5
DRAWS = 200


def rms_interval(prepared: Prepared, residual: Sequence[Array]) -> Array:
    """90 % interval (2, n) N·m of each joint's RMS residual over all runs; residual: a run, (M, n)."""
    squares, counts = [], []
    for run, values in zip(prepared.runs, residual, strict=True):
        block = blocks(run)
        sums = np.zeros((block[-1] + 1, prepared.joints))
        used = np.zeros_like(sums)
        np.add.at(sums, block, np.where(run.used, values, 0.0) ** 2)
        np.add.at(used, block, run.used)
        squares.append(sums)
        counts.append(used)
    square, count = np.concatenate(squares), np.concatenate(counts)
    drawn = np.sqrt(drawn_sums(square) / np.maximum(drawn_sums(count), 1))
    return np.quantile(drawn, [SIGNIFICANCE, 1 - SIGNIFICANCE], axis=0)


def blocks(run: Run) -> NDArray[np.int64]:
    """The block that each sample of a run is in, (M,), from 0 on."""
    return ((run.time - run.time[0]) / BLOCK_SECONDS).astype(np.int64)


def drawn_sums(sums: Array) -> Array:
    """Sums over all blocks (DRAWS, ...) as often as blocks are drawn anew; sums: a block each, (B, ...)."""
    count = len(sums)
    draws = np.random.default_rng(0).integers(0, count, (DRAWS, count))
    times = np.bincount((draws + count * np.arange(DRAWS)[:, None]).ravel(), minlength=DRAWS * count)
    return np.tensordot(times.reshape(DRAWS, count).astype(float), sums, axes=1)


def interval(drawn: Array) -> tuple[float, float]:
    """90 % interval of what was drawn, (DRAWS,)."""
    low, high = np.quantile(drawn, [SIGNIFICANCE, 1 - SIGNIFICANCE])
    return float(low), float(high)
