"""Quadratics within bounds: one of many unknowns, or many of a few at once."""

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve, solve_triangular
from scipy.optimize import lsq_linear

from identification.compiled import njit

Array = NDArray[np.float64]

# Of unknowns, relative, and of a matrix of unit diagonal, where it is a ridge that changes nothing.
ROUNDING = 1e-12
# Of a column's squares, against exact collinearity of a few.
SMALL_RIDGE = 1e-9
# Passes of an iteration that converges, at most.
SWEEPS = 500


def solve(matrix: Array, right: Array, lower: Array, upper: Array) -> Array:
    """Minimiser of x'Ax/2 - b'x within bounds; A (p, p) positive definite but for unknowns of no information.

    Those, which these rows do not reach, are left at zero. Where both bounds are one value, that is it.
    """
    if np.any(fixed := lower >= upper):
        found = np.where(fixed, lower, 0.0)
        left = right[~fixed] - matrix[np.ix_(~fixed, fixed)] @ lower[fixed]
        found[~fixed] = solve(matrix[np.ix_(~fixed, ~fixed)], left, lower[~fixed], upper[~fixed])
        return found
    dead = np.diag(matrix) <= 0
    matrix = np.where(dead[:, None] | dead, 0.0, matrix)
    matrix[dead, dead] = 1.0
    right = np.where(dead, 0.0, right)
    scale = 1 / np.sqrt(np.diag(matrix))
    factor = _factor(matrix * np.outer(scale, scale))
    free = scale * cho_solve(factor, scale * right)
    if np.all(free >= lower) and np.all(free <= upper):
        return free
    # Cholesky's last rows are the root of the normal equations of the last unknowns alone: what comes before
    # the first bounds follows from those.
    first = int(np.argmax(np.isfinite(lower) | np.isfinite(upper)))
    root = np.tril(factor[0])
    target = solve_triangular(root, scale * right, lower=True)
    bounds = (lower / scale)[first:], (upper / scale)[first:]
    last = lsq_linear(root[first:, first:].T, target[first:], bounds=bounds, method="bvls").x
    rest = target[:first] - root[first:, :first].T @ last
    return scale * np.append(solve_triangular(root[:first, :first], rest, lower=True, trans="T"), last)


def _factor(scaled: Array) -> tuple[Array, bool]:
    """Cholesky factor of a matrix (p, p) of unit diagonal, with a ridge where rounding leaves it none."""
    ridge = ROUNDING * np.eye(len(scaled))
    try:
        return cho_factor(scaled + ridge, lower=True)
    except np.linalg.LinAlgError:
        # Sums that others were subtracted from: a direction without information is rounding, of any sign.
        least = float(np.linalg.eigvalsh(scaled)[0])
        return cho_factor(scaled + ridge + 2 * abs(least) * np.eye(len(scaled)), lower=True)


def minimisers(matrix: Array, right: Array, size: Array, lower: Array, upper: Array) -> Array:
    """Minimisers (C, k) of c'Ac/2 - b'c within bounds, regularised against exact collinearity.

    size: (C, k) of A's diagonal before anything was taken off: rounding may leave less than nothing of it.
    """
    least = np.maximum(ROUNDING * size, np.finfo(float).tiny)
    scale = np.sqrt(np.maximum(np.einsum("caa->ca", matrix), least))
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
        if largest <= ROUNDING * (1.0 + np.abs(x).max()):
            break
