"""Output error with derivatives that are kept: a fit that starts near its end.

Position moves with links, friction and drives much alike, whatever one effect is beside them. So their
derivatives are simulated once, and each step costs a few simulations, not one for each unknown.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..chain import Chain
from .fit import GAIN, Fit, fitted, trial_steps
from .problem import Problem, summed
from .servo_run import ServoRun
from .unknowns import Unknowns

Array = NDArray[np.float64]

DAMPING = (1e-3, 0.1, 10.0, 1e3)
# Steps at most; how often the residual's weights are taken anew.
STEPS, PASSES = 8, 2


def fit_again(
    chain: Chain,
    unknown: Unknowns,
    runs: Sequence[ServoRun],
    start: Array,
    threads: int | None = None,
    passes: int = PASSES,
) -> Fit:
    """The fit from a start (m,) that is near its end, with derivatives taken there."""
    derivatives, _ = Problem(chain, unknown, runs, threads).derivatives(start, range(unknown.count))
    return frozen_fit(chain, unknown, runs, start, derivatives, threads, passes)


def frozen_fit(
    chain: Chain,
    unknown: Unknowns,
    runs: Sequence[ServoRun],
    start: Array,
    derivatives: Sequence[Array],
    threads: int | None = None,
    passes: int = PASSES,
) -> Fit:
    """The fit from a start (m,), with derivatives (M, n, k) of each window by the first k unknowns.

    Those by the others are simulated at each step.
    """
    problem = Problem(chain, unknown, runs, threads)
    kept = derivatives[0].shape[-1]
    fresh = range(kept, unknown.count)
    values, taken = problem.simulatable(unknown.held(start)), 0
    weights = problem.weights(values)
    for _ in range(passes):
        for _ in range(STEPS):
            information, gradient, cost = _linearised(problem, values, weights, derivatives, fresh)
            scaled = (values - unknown.mean) / unknown.deviation
            trials = trial_steps(unknown, values, information, gradient + scaled, np.array(DAMPING))
            costs = problem.costs(trials, weights)
            best = int(np.argmin(costs))
            gained = cost + 0.5 * float(scaled @ scaled) - costs[best]
            if not gained > 0:
                break
            values, taken = trials[best], taken + 1
            if gained < GAIN:
                break
        weights = problem.weights(values)
    information = _linearised(problem, values, weights, derivatives, fresh)[0]
    return fitted(problem, values, information, taken)


def _linearised(
    problem: Problem, values: Array, weights: Array, derivatives: Sequence[Array], fresh: Sequence[int]
) -> tuple[Array, Array, float]:
    """Information (n, m, m), gradient (m,) of the runs and their half squares, in the prior's units."""
    own, errors = problem.derivatives(values, fresh)
    whole = (np.concatenate(each, axis=-1) for each in zip(derivatives, own, strict=True))
    return summed(zip(whole, errors, strict=True), weights, problem.unknown.count)
