"""Weighted least squares: each joint's rows over that joint's residual deviation.

Gautier (1997), "Dynamic identification of robots with power model", section 3: the deviations
come from an ordinary fit first, and then once more from the fit they gave: the ordinary one loads
the joints of small torque with errors of the large.
"""

import numpy as np

from ..estimate import Estimate
from ..problem import Problem

PASSES = 2


def estimate(problem: Problem) -> Estimate:
    """beta = (W'S^-1 W)^-1 W'S^-1 tau, S the diagonal of residual variances of the fit before."""
    _ = problem.condition_number
    weights = np.ones(problem.equations)
    for _ in range(PASSES):
        weights = problem.residual_weights(problem.weighted_least_squares(weights))
    return problem.linear_estimate(problem.weighted_least_squares(weights), weights, "wls")
