"""Recursive total least squares, sample by sample.

Kubus, Kröger & Wahl (2008), "On-line estimation of inertial parameters using a recursive total
least-squares approach": as samples arrive the triangular factor of [W tau] is updated, and its
smallest direction followed by inverse iteration, one step a sample.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular

from ..estimate import Estimate
from ..kinematics import kernel
from ..problem import Problem
from . import wls
from .tls import row_noise

Array = NDArray[np.float64]

# Iterations after the last sample of a recording, until the direction has settled to this.
FINAL_STEPS = 1000
SETTLED = 1e-9
# A column is new where this share of it is not in the columns before.
SMALLEST_PIVOT = 1e-8


class RecursiveTotalLeastSquares:
    """An estimate of b parameters that follows a stream of equations, rows @ beta = torque.

    noise: (b + 1, b + 1) covariance of a row's noise, regressor then torque (only its shape matters).
    forgetting: the weight of what was seen, multiplied in at every update; 1 forgets nothing.
    """

    def __init__(self, noise: Array, forgetting: float = 1.0):
        self._noise = noise
        self._forgetting = forgetting
        self._factor = np.zeros_like(noise)
        self._direction = np.zeros(len(noise))
        self._direction[-1] = -1.0
        self._determined = False

    def update(self, rows: Array, torque: Array) -> None:
        """Take in one instant: rows (k, b) and torque (k,), divided by their noise if it differs."""
        self._factor *= np.sqrt(self._forgetting)
        _absorb(self._factor, np.column_stack([rows, torque]))
        if not self._determined:
            pivots = np.abs(np.diag(self._factor))[:-1]
            norms = np.linalg.norm(self._factor[:, :-1], axis=0)
            self._determined = bool(np.all(pivots > SMALLEST_PIVOT * norms))
        if self._determined:
            self.iterate()

    def iterate(self) -> float:
        """One inverse iteration z <- (R'R)^-1 C z, which turns z towards the smallest direction.

        Returns how far the unit vector z has moved.
        """
        factor = self._factor.copy()
        # Exact data leave no residual to divide by.
        smallest = np.finfo(float).eps * np.linalg.norm(factor[:, -1])
        factor[-1, -1] = max(abs(factor[-1, -1]), smallest)
        image = solve_triangular(factor, self._noise @ self._direction, trans="T", check_finite=False)
        direction = solve_triangular(factor, image, check_finite=False)
        direction /= np.linalg.norm(direction)
        moved = float(np.linalg.norm(direction - self._direction))
        self._direction = direction
        return moved

    @property
    def values(self) -> Array:
        """The estimate so far, (b,); NaN until what was seen has excited every parameter."""
        if not self._determined:
            return np.full(len(self._factor) - 1, np.nan)
        return -self._direction[:-1] / self._direction[-1]


@kernel
def _absorb(factor: Array, rows: Array) -> None:
    """Update the triangular factor R to that of [R; rows] by Givens rotations; ``rows`` is used up."""
    size = factor.shape[0]
    for row in rows:
        for i in range(size):
            if row[i] == 0.0:
                continue
            radius = np.hypot(factor[i, i], row[i])
            c, s = factor[i, i] / radius, row[i] / radius
            for k in range(i, size):
                above, below = factor[i, k], row[k]
                factor[i, k] = c * above + s * below
                row[k] = c * below - s * above


def estimate(problem: Problem) -> Estimate:
    """The stream's last value, every run replayed instant by instant; rows weighted as in wls."""
    first = wls.estimate(problem)
    weights = problem.residual_weights(first.values)
    stream = RecursiveTotalLeastSquares(row_noise(problem, first.values, weights))
    for run in problem.observations:
        for rows, torque, used in zip(run.regressor, run.torque, run.used, strict=True):
            scale = weights[used]
            stream.update(rows[used] * scale[:, None], torque[used] * scale)
    for _ in range(FINAL_STEPS):
        if stream.iterate() < SETTLED:
            break
    return problem.linear_estimate(stream.values, weights, "recursive_tls")
