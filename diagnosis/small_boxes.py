"""Many small box-constrained quadratics at once."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from .evidence import RIDGE

Array = NDArray[np.float64]

# Against exact collinearity within a candidate, relative.
SMALL_RIDGE = 1e-9
SWEEPS, CONVERGED = 500, 1e-12


def minimisers(matrix: Array, right: Array, size: Array, lower: Array, upper: Array) -> Array:
    """Minimisers (C, k) of c'Ac/2 - b'c within bounds, regularised against exact collinearity.

    size: (C, k) of A's diagonal before anything was taken off: rounding may leave less than nothing of it.
    """
    scale = np.sqrt(np.maximum(np.einsum("caa->ca", matrix), RIDGE * size))
    scaled = matrix / (scale[:, :, None] * scale[:, None, :]) + SMALL_RIDGE * np.eye(right.shape[1])
    target = right / scale
    free = np.linalg.solve(scaled, target[:, :, None])[:, :, 0]
    low, high = lower * scale, upper * scale
    for c in np.flatnonzero(np.any((free < low) | (free > high), axis=1)):
        _box_minimum(scaled[c], target[c], low[c], high[c], free[c])
    return free / scale


@njit(cache=True, nogil=True)
def _box_minimum(matrix: Array, right: Array, lower: Array, upper: Array, x: Array) -> None:
    """Coordinate descent on a small box-constrained quadratic of unit diagonal, from x, in place."""
    k = x.size
    for a in range(k):
        x[a] = min(max(x[a], lower[a]), upper[a])
    for _ in range(SWEEPS):
        largest = 0.0
        for a in range(k):
            slope = right[a]
            for b in range(k):
                slope -= matrix[a, b] * x[b]
            new = min(max(x[a] + slope / matrix[a, a], lower[a]), upper[a])
            largest = max(largest, abs(new - x[a]))
            x[a] = new
        if largest <= CONVERGED * (1.0 + np.abs(x).max()):
            break
