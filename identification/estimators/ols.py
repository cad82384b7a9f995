"""Ordinary least squares: every row counts alike, whatever its joint's noise."""

import numpy as np

from ..estimate import Estimate
from ..problem import Problem


def estimate(problem: Problem) -> Estimate:
    """beta = (W'W)^-1 W'tau by QR of the column-scaled regressor."""
    _ = problem.condition_number
    weights = np.ones(problem.equations)
    return problem.linear_estimate(problem.weighted_least_squares(weights), weights, "ols")
