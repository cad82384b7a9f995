"""Direct and inverse dynamic identification models: torque fitted along the simulated motion.

Gautier, Janot & Vandanjon (2013), "A new closed-loop output error method for parameter identification
of robot dynamics", IEEE TCST 21(2): minimise |tau - W(q_sim(beta_k)) beta|² by a few least-squares
passes. No position is differentiated, so encoder noise does not enter the regressor.
"""

from dataclasses import replace

import numpy as np

from ..estimate import Estimate
from ..problem import Problem
from ..simulated_motion import (
    require_torque_equations,
    simulatable,
    simulate_values,
    simulated_equations,
)
from . import wls

PASSES = 4
# Stop when no parameter moves by more than this share of its deviation, or of its value: sticking and
# slipping change with the parameters in jumps, which leave a jitter of about that size.
TOLERANCE, RELATIVE_TOLERANCE = 0.1, 1e-4


def estimate(problem: Problem) -> Estimate:
    """beta_k+1 = weighted least squares of the measured torque on W(q_sim(beta_k)), until it settles.

    Starts from the fit to the measured motion. Raises InputError when the logs tell no reference or
    controller, and for other models than the inverse dynamic.
    """
    require_torque_equations(problem, "didim")
    values = wls.estimate(problem).values
    for _ in range(PASSES):
        (simulated,) = simulate_values(problem, simulatable(problem, values)[None])
        found = wls.estimate(replace(problem, observations=simulated_equations(problem, simulated)))
        moved, values = np.abs(found.values - values), found.values
        if np.all(moved <= np.maximum(TOLERANCE * found.std, RELATIVE_TOLERANCE * np.abs(values))):
            break
    std, _ = problem.residual_std(values)
    return replace(found, estimator="didim", noise_std=std, condition_number=problem.condition_number)
