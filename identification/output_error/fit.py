"""Output error: the unknowns whose simulated closed loop moves as the robot did.

Minimises half of sum_j |q_j - q_sim,j(x)|² / (s_j² f_j) + |(x - mean) / deviation|² by Levenberg-Marquardt.
s_j and f_j are the residual's deviation and its inflation by autocorrelation: ten periods of one slow error
count for ten samples, not for thousands.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..chain import Chain
from .problem import Problem, spread
from .servo_run import ServoRun
from .unknowns import Unknowns

Array = NDArray[np.float64]

# Levenberg's factor at first and at least, what a failed and a good step multiply it by, and how many fail.
DAMPING, LEAST, HARDER, EASIER, TRIALS = 1e-2, 1e-8, 10.0, 0.1, 6
ITERATIONS, REWEIGHTINGS = 30, 3
# Stop when an iteration gains less log-likelihood, or weights change by less than this share.
GAIN, SETTLED = 1e-2, 0.05
# Of the cost, what an iteration gains at least on the way to a first guess.
ROUGH = 0.01


@dataclass(frozen=True)
class Fit:
    """Values (m,) of the unknowns and their covariance (m, m).

    residual_std, inflation: (n,) rad, and its factor by autocorrelation. effective_samples: (n,).
    information: (n, m, m) of the runs alone, by the joint whose position tells it, in the prior's units.
    iterations: of Levenberg-Marquardt.
    """

    unknowns: Unknowns
    values: Array
    covariance: Array
    residual_std: Array
    inflation: Array
    effective_samples: Array
    information: Array
    iterations: int

    @property
    def std(self) -> Array:
        """Deviations (m,)."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def table(self) -> Array:
        """The plant's table (n, WIDTH)."""
        return self.unknowns.table(self.values)


def fit(
    chain: Chain,
    unknown: Unknowns,
    runs: Sequence[ServoRun],
    start: Array,
    threads: int | None = None,
) -> Fit:
    """The fit of a limb's runs from a start (m,). All runs are sampled at one rate, or each at its own."""
    problem = Problem(chain, unknown, runs, threads)
    values = problem.simulatable(unknown.held(start))
    # First every sample counts: by a start that is far off, all errors are slow, and the prior would rule.
    guess, taken = _minimised(problem, values, problem.weights(values, counts_all=True), ROUGH)
    return _settled(problem, guess, REWEIGHTINGS - 1, taken)


def fit_near(
    chain: Chain, unknown: Unknowns, runs: Sequence[ServoRun], start: Array, threads: int | None = None
) -> Fit:
    """The fit from a start (m,) that is near its end."""
    problem = Problem(chain, unknown, runs, threads)
    return _settled(problem, problem.simulatable(unknown.held(start)), REWEIGHTINGS, 0)


def _settled(problem: Problem, values: Array, passes: int, iterations: int) -> Fit:
    """The fit from values (m,) by weights that are taken anew after each pass, until they stay."""
    weights = problem.weights(values)
    for _ in range(passes):
        values, taken = _minimised(problem, values, weights)
        iterations += taken
        before, weights = weights, problem.weights(values)
        if np.all(np.abs(weights / before - 1) < SETTLED):
            break
    return fitted(problem, values, problem.linearised(values, weights)[0], iterations)


def fitted(problem: Problem, values: Array, information: Array, iterations: int) -> Fit:
    """The fit that ended at values (m,), with the runs' information (n, m, m) there."""
    unknown = problem.unknown
    scale = unknown.deviation
    covariance = np.linalg.inv(information.sum(axis=0) + np.eye(unknown.count)) * np.outer(scale, scale)
    residuals = problem.residuals(values)
    std, inflation = spread(residuals)
    return Fit(
        unknowns=unknown,
        values=values,
        covariance=covariance,
        residual_std=std,
        inflation=inflation,
        effective_samples=sum(len(each) for each in residuals) / inflation,
        information=information,
        iterations=iterations,
    )


def trial_steps(unknown: Unknowns, values: Array, information: Array, slope: Array, damping: Array) -> Array:
    """Levenberg-Marquardt's steps from values (m,), within the bounds, one a damping: (T, m).

    information: (n, m, m) of the runs. slope: (m,) of the whole cost, both in the prior's units.
    """
    matrix = information.sum(axis=0) + np.eye(unknown.count)
    # What lies on a bound and is pushed beyond it stays there.
    pushed = ((values <= unknown.lower) & (slope > 0)) | ((values >= unknown.upper) & (slope < 0))
    free = np.flatnonzero(~pushed)
    trials = np.tile(values, (len(damping), 1))
    for trial, factor in zip(trials, damping, strict=True):
        own = matrix[np.ix_(free, free)].copy()
        own[np.diag_indices(len(free))] *= 1 + factor
        trial[free] -= np.linalg.solve(own, slope[free]) * unknown.deviation[free]
    return unknown.held(trials)


def _minimised(problem: Problem, values: Array, weights: Array, share: float = 0.0) -> tuple[Array, int]:
    """Levenberg-Marquardt from values (m,), within the bounds; the values and how many iterations it took.

    share: of the cost, which an iteration gains at least.
    """
    unknown, damping = problem.unknown, DAMPING
    for iteration in range(1, ITERATIONS + 1):
        information, gradient, total = problem.linearised(values, weights)
        scaled = (values - unknown.mean) / unknown.deviation
        cost = total + 0.5 * float(scaled @ scaled)
        for _ in range(TRIALS):
            (trial,) = trial_steps(unknown, values, information, gradient + scaled, np.array([damping]))
            (reached,) = problem.costs(trial[None], weights)
            if reached < cost:
                break
            damping *= HARDER
        else:
            return values, iteration
        damping = max(damping * EASIER, LEAST)
        gained, values = cost - reached, trial
        if gained < max(GAIN, share * cost):
            return values, iteration
    return values, ITERATIONS
