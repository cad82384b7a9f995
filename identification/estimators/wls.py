"""Weighted least squares: each joint's rows over that joint's residual deviation.

Gautier (1997), "Dynamic identification of robots with power model", section 3: the deviations
come from an ordinary fit first.
"""

import numpy as np

from ..estimate import Estimate
from ..problem import Problem


def estimate(problem: Problem) -> Estimate:
    """beta = (W'S^-1 W)^-1 W'S^-1 tau, S the diagonal of residual variances of an ordinary fit."""
    _ = problem.condition_number
    ordinary = problem.weighted_least_squares(np.ones(problem.equations))
    weights = problem.residual_weights(ordinary)
    return problem.linear_estimate(problem.weighted_least_squares(weights), weights, "wls")
