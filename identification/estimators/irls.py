"""Iteratively reweighted least squares: the joints' full residual covariance, and robust weights.

Generalised least squares with the n x n covariance of the joints' residuals estimated anew in each
pass (Gautier & Poignet 2001), and Huber's weight on instants whose residual is improbably large
(Huber & Ronchetti, "Robust Statistics", 2009, ch. 8).
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri

from ..estimate import Estimate
from ..problem import Problem
from . import wls

Array = NDArray[np.float64]

PASSES = 10
# Stop when no parameter moves by more than this share of its first standard deviation.
TOLERANCE = 1e-2
# Of normal residuals, this share is taken for large.
TAIL = 0.01
# Residual correlations are kept this far from singular: some pairs of joints rarely move together.
SMALLEST_EIGENVALUE = 1e-2


def estimate(problem: Problem) -> Estimate:
    """beta = argmin sum_k w_k² e_k'O^-1 e_k, with O and w from the residuals e of the pass before."""
    first = wls.estimate(problem)
    values, equal = first.values, np.ones(problem.equations)
    robust = [np.ones(len(run.torque)) for run in problem.observations]
    for _ in range(PASSES):
        joint = _joint_covariance(problem, values, robust)
        robust = [_robust_weights(run.residual(values), run.used, joint) for run in problem.observations]
        white = problem.whitened([joint / w[:, None, None] ** 2 for w in robust])
        before, values = values, white.weighted_least_squares(equal)
        if np.all(np.abs(values - before) <= TOLERANCE * first.std):
            break
    found = white.linear_estimate(values, equal, "irls")
    std, _ = problem.residual_std(values)
    return replace(found, noise_std=std, condition_number=problem.condition_number)


def _joint_covariance(problem: Problem, values: Array, robust: list[Array]) -> Array:
    """Covariance of an instant's residuals, (e, e), widened by each equation's inflation.

    Each pair of equations is averaged over the instants that use both.
    """
    products = np.zeros((problem.equations, problem.equations))
    counts = np.zeros_like(products)
    for run, weight in zip(problem.observations, robust, strict=True):
        residual = np.where(run.used, run.residual(values), 0.0) * weight[:, None]
        present = run.used * weight[:, None]
        products += residual.T @ residual
        counts += present.T @ present
    covariance = products / np.maximum(counts, 1.0)
    std = np.sqrt(np.diag(covariance))
    # Noise-free data would divide by zero.
    std = np.maximum(std, 1e-9 * np.max(std) + np.finfo(float).tiny)
    eigenvalues, vectors = np.linalg.eigh(covariance / np.outer(std, std))
    correlation = (vectors * np.maximum(eigenvalues, SMALLEST_EIGENVALUE)) @ vectors.T
    _, inflation = problem.residual_std(values)
    scale = std * np.sqrt(inflation)
    return correlation * np.outer(scale, scale)


def _robust_weights(residual: Array, used: NDArray[np.bool_], joint: Array) -> Array:
    """Huber's weight of each instant, (M,): 1, or the bound over the Mahalanobis distance beyond it."""
    both = used[:, :, None] & used[:, None, :]
    masked = np.where(both, joint, np.eye(len(joint)))
    inside = np.where(used, residual, 0.0)
    squared = np.sum(inside * np.linalg.solve(masked, inside[:, :, None])[:, :, 0], axis=1)
    bound = chdtri(np.maximum(used.sum(axis=1), 1), TAIL)
    return np.sqrt(bound / np.maximum(squared, bound))
