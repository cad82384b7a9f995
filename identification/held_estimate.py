"""An estimate that keeps at the model what its runs do not move, and predicts left-out runs no worse."""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from .determination import Determination, determination
from .estimate import Estimate
from .estimators import WITH_PRIOR, estimate, wls
from .observations import Observations
from .prior import BasePrior, base_prior, parameter_widths
from .problem import Problem
from .shrinkage import STRENGTHS, Products, Shrinkage, shrinkage

Array = NDArray[np.float64]

# With so few runs, this many parts of each are left out in turn instead of whole runs.
PARTS = {1: 6, 2: 3}
# A joint at rest counts as moving by this, rad/s (m/s) and rad/s² (m/s²); its torque is at least this share
# of the strongest joint's.
SLOWEST, LEAST_TORQUE = 0.01, 1e-9


@dataclass(frozen=True)
class Held:
    """estimate: the parameters. shrinkage: how far they were let from the model; None for an estimator that
    takes no prior, which must excite all. determination: what the runs tell.
    """

    estimate: Estimate
    shrinkage: Shrinkage | None
    determination: Determination


def held_estimate(problem: Problem, estimator: str) -> Held:
    """The estimate with a prior about the model, of the strength that left-out runs ask for.

    Raises InputError for an unknown estimator, and for one without a prior where the runs leave a base
    parameter unexcited.
    """
    prior = base_prior(
        problem.base, problem.nominal, parameter_widths(problem.nominal, *motion_scales(problem))
    )
    weak = replace(problem, prior=prior.of_strength(STRENGTHS[-1]))
    first = wls.estimate(weak).values
    weights = weak.residual_weights(first)
    noise = weak.row_noise(first, weights)
    determined = determination(weak, prior, weights, noise)
    if estimator not in WITH_PRIOR:
        return Held(estimate(problem, estimator), None, determined)
    chosen = shrinkage(
        fold_products(problem.observations, prior.mean), weights / noise, prior.precision, measures(problem)
    )
    held = replace(problem, prior=prior.of_strength(chosen.strength))
    return Held(_scaled(held, estimate(held, estimator), prior, chosen.factor), chosen, determined)


def motion_scales(problem: Problem) -> tuple[Array, Array, Array]:
    """RMS of torque, speed and acceleration of each joint over all runs, (n,) each, none of them zero."""
    torque = _rms([motion.torque for motion in problem.motions])
    speed = _rms([run.dq for run in problem.observations])
    acceleration = _rms([np.gradient(run.dq, 1 / run.sample_rate, axis=0) for run in problem.observations])
    least = max(LEAST_TORQUE * float(torque.max()), np.finfo(float).tiny)
    return np.maximum(torque, least), np.maximum(speed, SLOWEST), np.maximum(acceleration, SLOWEST)


def measures(problem: Problem) -> tuple[Array, Array]:
    """Weights (e,) of the two errors that left-out rows are judged by: of all torque together, and of each
    equation as a share of its own.
    """
    squares = sum(np.sum(np.where(run.used, run.torque, 0.0) ** 2, axis=0) for run in problem.observations)
    own = np.sqrt(np.asarray(squares, dtype=np.float64))
    return np.ones(problem.equations), np.divide(1.0, own, out=np.zeros_like(own), where=own > 0)


def fold_products(runs: Sequence[Observations], mean: Array) -> Products:
    """Products of the rows of each fold: whole runs, or parts of them where there are few.

    mean: (b,) base parameters of the model as given.
    """
    folds = []
    for run in runs:
        edges = np.linspace(0, len(run.time), PARTS.get(len(runs), 1) + 1).astype(int)
        folds += [(run, slice(*pair)) for pair in itertools.pairwise(edges.tolist())]
    equations, count = runs[0].torque.shape[1], len(mean)
    xx = np.zeros((len(folds), equations, count, count))
    xy, yy = np.zeros((len(folds), equations, count)), np.zeros((len(folds), equations))
    for fold, (run, part) in enumerate(folds):
        for equation in range(equations):
            used = run.used[part, equation]
            rows = run.regressor[part, equation][used]
            gap = run.torque[part, equation][used] - rows @ mean
            xx[fold, equation], xy[fold, equation], yy[fold, equation] = (
                rows.T @ rows,
                rows.T @ gap,
                gap @ gap,
            )
    return Products(xx, xy, yy)


def _scaled(problem: Problem, found: Estimate, prior: BasePrior, factor: float) -> Estimate:
    """The estimate with its change of the model scaled by a factor."""
    if factor == 1.0:
        return found
    change = found.values - prior.mean
    values = prior.mean + factor * change
    back = (1 - factor) * change
    std, _ = problem.residual_std(values)
    standard = found.standard
    return replace(
        found,
        values=values,
        # What the factor takes back is an error of known size, as far as the estimate is right.
        covariance=found.covariance + np.outer(back, back),
        noise_std=std,
        standard=None if standard is None else problem.nominal + factor * (standard - problem.nominal),
    )


def _rms(arrays: Sequence[Array]) -> Array:
    return np.sqrt(np.mean(np.concatenate(arrays) ** 2, axis=0))
