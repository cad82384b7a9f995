"""Weighted least squares over parameters that a real arm could have, with a faint pull to the model.

Every link's pseudo-inertia is positive definite, armature and friction are not negative: see
physical_consistency.py. It is the one estimator that also finds a full standard vector.
"""

from dataclasses import replace

from ..estimate import Estimate
from ..physical_consistency import nearest_consistent
from ..problem import Problem
from ..row_parts import triangle
from . import wls


def estimate(problem: Problem) -> Estimate:
    """The consistent parameters of least weighted squares and divergence; ``standard`` holds all 14 n.

    The covariance is that of the unconstrained estimate, which the constraints can only narrow.
    """
    free = wls.estimate(problem)
    weights = problem.residual_weights(free.values)
    noise = problem.row_noise(free.values, weights)
    root_information = triangle(rows for rows, _ in problem.weighted_parts(weights, noise))
    standard = nearest_consistent(problem.base, free.values, root_information, problem.nominal)
    found = problem.linear_estimate(problem.base.values(standard), weights, "physically_consistent")
    return replace(found, standard=standard)
