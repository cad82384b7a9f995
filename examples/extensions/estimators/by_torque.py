"""Least squares with each joint's rows over the RMS of that joint's torque."""

import numpy as np

from ..estimate import Estimate
from ..problem import Problem


def estimate(problem: Problem) -> Estimate:
    """beta = (W'S^-1 W)^-1 W'S^-1 tau, S the diagonal of mean squared torques."""
    _ = problem.condition_number
    _, torque, joint = problem.stacked
    weights = 1 / np.sqrt(np.bincount(joint, torque**2) / np.bincount(joint))
    return problem.linear_estimate(problem.weighted_least_squares(weights), weights, "by_torque")
