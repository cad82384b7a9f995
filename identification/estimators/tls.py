"""Total least squares: the regressor is noisy too.

Generalised total least squares (Van Huffel & Vandewalle, "The Total Least Squares Problem", 1991,
ch. 10): the smallest z'[W tau]'[W tau] z / z'C z over z = (beta, -1), with C the covariance of a
row's noise: encoder noise carried through the pipeline for W, the rest of the residual for tau.
Columns scaled by their noise are the special case of a diagonal C.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular

from ..estimate import Estimate
from ..measurement_noise import regressor_noise, torque_variance
from ..problem import Problem
from . import wls

Array = NDArray[np.float64]


def estimate(problem: Problem) -> Estimate:
    """beta from the smallest generalised singular direction of [W tau], rows weighted as in wls."""
    first = wls.estimate(problem)
    weights = problem.residual_weights(first.values)
    rows, torque, joint = problem.stacked
    scale = weights[joint]
    noise = row_noise(problem, first.values, weights)
    upper = np.asarray(np.linalg.qr(np.column_stack([rows, torque]) * scale[:, None], mode="r"))
    return problem.linear_estimate(smallest_direction(upper, noise), weights, "tls")


def row_noise(problem: Problem, values: Array, weights: Array) -> Array:
    """Mean noise covariance of a weighted row of [W tau], (b + 1, b + 1).

    values: (b,) of a first estimate, whose residual is split into encoder and torque noise.
    """
    b = problem.base.count
    noise = np.zeros((b + 1, b + 1))
    noise[:b, :b], each = regressor_noise(problem, weights)
    std, _ = problem.residual_std(values)
    from_encoders = np.einsum("a,eab,b->e", values, each, values)
    of_torque = torque_variance(std**2, from_encoders)
    counts = problem.counts
    noise[b, b] = np.sum(counts * weights**2 * of_torque) / counts.sum()
    return noise


def smallest_direction(upper: Array, noise: Array) -> Array:
    """Values (b,) with (values, -1) along the smallest |R z|² / z'C z.

    upper: (b + 1, b + 1) triangular factor R of [W tau]. noise: C, positive semidefinite.
    """
    # On exact data the last diagonal vanishes and with it the answer's scale.
    residual = max(abs(upper[-1, -1]), np.finfo(float).eps * np.linalg.norm(upper[:, -1]))
    factor = upper.copy()
    factor[-1, -1] = residual
    inverse = solve_triangular(factor, np.eye(len(factor)))
    # With y = R z this is the largest y'(R^-T C R^-1) y, where C may be singular.
    _, vectors = np.linalg.eigh(inverse.T @ noise @ inverse)
    direction = vectors[:, -1]
    along = direction[:-1] / direction[-1] * residual
    return solve_triangular(factor[:-1, :-1], factor[:-1, -1] - along)
