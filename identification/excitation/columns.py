"""Columns of a trajectory basis: what its free coefficients multiply."""

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular

Array = NDArray[np.float64]


def with_constant(position: Array, velocity: Array, acceleration: Array) -> tuple[Array, Array, Array]:
    """The columns (N, m) of q, dq and ddq with a first one for a constant position, (N, 1 + m) each."""
    one, zero = np.ones((len(position), 1)), np.zeros((len(position), 1))
    return np.hstack([one, position]), np.hstack([zero, velocity]), np.hstack([zero, acceleration])


def orthonormal_combinations(velocity: Array) -> Array:
    """(m, m) upper triangular C: velocities (N, m) @ C are orthogonal, of RMS 1 / sqrt(2) like a harmonic.

    Columns that look alike would make an optimiser crawl, and random coefficients cancel.
    """
    gram = velocity.T @ velocity / len(velocity)
    scale = np.sqrt(np.diag(gram))
    upper = np.linalg.cholesky(gram / np.outer(scale, scale)).T
    combinations = solve_triangular(upper, np.eye(len(scale))) / np.sqrt(2)
    return combinations / scale[:, None]
