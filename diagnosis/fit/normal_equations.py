"""Normal equations of a hypothesis, fold by fold and joint by joint, and its fit.

Rows are weighted with one over each joint's long-run residual variance, so that squared sums are in
units of chi-squared for coloured residuals too.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from identification.covariance import variance_inflation

from ..data.run import Prepared
from ..model.base_regressor import BaseRegressor
from ..model.candidate import Candidate
from ..model.hypothesis import Design, bounds, design, likeliest_scales, scaled_precision
from .bounded import ROUNDING, SWEEPS, solve

Array = NDArray[np.float64]

# What all runs together fit, but for this share of it, each of them was extrapolated to.
FITTED_LEFT = 0.3
WEIGHT_PASSES = 3
# A model is poor from this variance scale of the prior on; there it is made to converge within each pass, to
# this share of itself, and taken where it is so many times the one that lags.
POOR, SCALE_CONVERGED, LAGS = 3.0, 0.01, 5.0
# Misfit can be coloured without end; a joint must not lose its say altogether over it.
LARGEST_INFLATION = 10.0


@dataclass(frozen=True)
class Fit:
    """A hypothesis fitted to all folds.

    values: (p,). covariance: (p, p). weights: (n,) one over the long-run residual variance.
    objective: weighted squared residual plus prior. prior_scales: (2,) the prior's variances by kind.
    residual: a run, (M, n) N·m, zero where unused. held_out: likewise, each fold predicted from the others
    but for events, which are taken off as they were. apart: (F, p), the values that predict each fold.
    """

    values: Array
    covariance: Array
    weights: Array
    objective: float
    prior_scales: Array
    residual: tuple[Array, ...]
    held_out: tuple[Array, ...]
    apart: Array
    bounds: tuple[Array, Array]

    def wald(self, part: slice) -> float:
        """Wald's statistic of some of the values: squared standard deviations from zero, summed."""
        own = self.values[part]
        return float(own @ np.linalg.pinv(self.covariance[part, part]) @ own)


def fit(hypothesis: Design, like: Fit | None = None) -> Fit:
    """Weights, prior scales and values estimated in turn; then every fold predicted from the others.

    like: with this fit's weights and prior scales instead, by which hypotheses can be compared.
    """
    lower, upper = bounds(hypothesis)
    weights, prior_scales = (
        _weights_and_scale(hypothesis) if like is None else (like.weights, like.prior_scales)
    )
    folds = hypothesis.weighted(weights)
    information = folds[0].sum(axis=0)
    information[np.diag_indices_from(information)] += scaled_precision(hypothesis, prior_scales) + ROUNDING
    values = _values(hypothesis, folds, prior_scales, (lower, upper))
    residual = _residual(hypothesis, values)
    distance = float(values**2 @ scaled_precision(hypothesis, prior_scales))
    fitted = Fit(
        values=values,
        covariance=np.linalg.pinv(information, hermitian=True),
        weights=weights,
        objective=sum(float(np.sum(weights * r**2)) for r in residual) + distance,
        prior_scales=prior_scales,
        residual=residual,
        held_out=(),
        apart=np.zeros((0, len(values))),
        bounds=(lower, upper),
    )
    return _with_held_out(hypothesis, fitted, folds, hypothesis.base.folds)


def _weights_and_scale(hypothesis: Design) -> tuple[Array, Array]:
    """One over each joint's long-run residual variance (n,), and the prior's variance scales (2,).

    The scales lag a pass behind, lest an effect that is yet to be taken in loosens the parameters; but those
    of a model that is far from the robot they would hold back, and what that leaves looks like effects.
    """
    found = _in_turn(hypothesis, 1)
    if np.any(found[1] > POOR):
        converged = _in_turn(hypothesis, SWEEPS)
        if np.any(converged[1] > LAGS * found[1]):
            return converged
    return found


def _in_turn(hypothesis: Design, scale_passes: int) -> tuple[Array, Array]:
    """Weights and the prior's scales, each by the other's last values."""
    weights = 1 / np.maximum(np.var(np.concatenate(hypothesis.gap), axis=0), 1e-30)
    limits, scale = bounds(hypothesis), np.ones(len(hypothesis.kinds))
    for _ in range(WEIGHT_PASSES):
        folds = hypothesis.weighted(weights)
        for _ in range(scale_passes):
            values, before = _values(hypothesis, folds, scale, limits), scale
            scale = likeliest_scales(hypothesis, values)
            if np.all(np.abs(scale - before) < SCALE_CONVERGED * scale):
                break
        variance, inflation = variance_inflation(_residual(hypothesis, values), hypothesis.used)
        weights = 1 / np.maximum(variance * np.minimum(inflation, LARGEST_INFLATION), 1e-30)
    return weights, scale


def on_whole_runs(hypothesis: Design, fitted: Fit) -> Fit:
    """The fit with whole runs held out, each predicted from the others; as it is where there is only one.

    No other run has a joint that moves in one run alone: there, parts of that run are held out.
    """
    prepared = hypothesis.prepared
    if len(prepared.runs) == 1 or len(prepared.runs) == len(prepared.folds):
        return fitted
    whole = tuple((run, slice(0, len(each.time))) for run, each in enumerate(prepared.runs))
    of_run = np.array([run for run, _ in prepared.folds])
    folds = tuple(
        np.stack([part[of_run == run].sum(axis=0) for run, _ in whole])
        for part in hypothesis.weighted(fitted.weights)
    )
    found = _with_held_out(hypothesis, fitted, folds, whole)
    parts = zip(prepared.moved_alone, fitted.held_out, found.held_out, strict=True)
    return replace(found, held_out=tuple(np.where(own, part, left) for own, part, left in parts))


def _with_held_out(
    hypothesis: Design, fitted: Fit, sums: tuple[Array, ...], folds: Sequence[tuple[int, slice]]
) -> Fit:
    """The fit with each fold predicted from the others. sums: the folds', weighted."""
    events = np.concatenate(
        [np.zeros(hypothesis.parameters, bool), *(np.full(c.count, c.is_event) for c in hypothesis.accepted)]
    )
    held_out = [np.zeros_like(gap) for gap in hypothesis.gap]
    apart = np.zeros((len(folds), len(fitted.values)))
    for fold, (run, part) in enumerate(folds):
        rest = tuple(np.delete(each, fold, axis=0) for each in sums)
        apart[fold] = _values(hypothesis, rest, fitted.prior_scales, fitted.bounds)
        # No other run predicts an event: it is distinguished from what the model predicts, not predicted.
        apart[fold, events] = fitted.values[events]
        held_out[run][part] = _left(hypothesis, run, part, apart[fold])
    return replace(fitted, held_out=tuple(held_out), apart=apart)


def fitted_to(base: BaseRegressor, accepted: Sequence[Candidate]) -> tuple[Design, Fit]:
    """The hypothesis that these effects act, and its fit."""
    hypothesis = design(base, accepted)
    return hypothesis, fit(hypothesis)


def standard_values(prepared: Prepared, values: Array) -> Array:
    """Standard parameters (14 links,) of a hypothesis's unknowns (p,)."""
    return prepared.nominal + values[: len(prepared.nominal)]


def squares(residual: Sequence[Array]) -> Array:
    """Sum of squares of each joint over all runs (M, n), (n,)."""
    return np.sum([np.sum(run**2, axis=0) for run in residual], axis=0)


def log_of_squares(independent: Array, squared: Array) -> float:
    """Log-likelihood of squared residuals (n,) of so many independent samples (n,); up to a constant."""
    return -0.5 * float(np.sum(independent * np.log(np.maximum(squared, 1e-300))))


def rms(residual: Sequence[Array], hypothesis: Design) -> Array:
    """RMS (n,) of all runs (M, n) over the samples that count; what is left is zero elsewhere."""
    return np.sqrt(squares(residual) / np.maximum(hypothesis.counts, 1))


def is_extrapolated(together: Array, left_out: Array) -> NDArray[np.bool_]:
    """Whether a part of the runs is extrapolated to: its held-out residual is far above the fitted one.

    Such a held-out residual says nothing of the robot, since no other part of the runs determines it.

    together, left_out: squared residuals of what is fitted to all runs, and of each part without it.
    """
    return together < FITTED_LEFT**2 * left_out


def _values(
    hypothesis: Design, folds: tuple[Array, ...], prior_scales: Array, bounds: tuple[Array, Array]
) -> Array:
    """Unknowns (p,) from weighted sums of some folds, (F, p, p) and (F, p)."""
    matrix, right = (part.sum(axis=0) for part in folds)
    matrix[np.diag_indices_from(matrix)] += scaled_precision(hypothesis, prior_scales)
    return solve(matrix, right, *bounds)


def _residual(hypothesis: Design, values: Array) -> tuple[Array, ...]:
    return tuple(_left(hypothesis, run, slice(None), values) for run in range(len(hypothesis.gap)))


def _left(hypothesis: Design, run: int, part: slice, values: Array) -> Array:
    """Residual (M, n) N·m of a part of one run; zero where samples do not count."""
    left = left_everywhere(hypothesis, run, part, values)
    return np.where(hypothesis.prepared.runs[run].used[part], left, 0.0)


def left_everywhere(hypothesis: Design, run: int, part: slice, values: Array) -> Array:
    """The same where samples do not count, too."""
    base = hypothesis.base
    own = values[: base.parameters]
    each = enumerate(base.loading)
    fitted = np.column_stack([base.columns(run, joint, part) @ own[loading] for joint, loading in each])
    left = base.gap[run][part] - fitted
    for candidate, part_of in zip(hypothesis.accepted, hypothesis.parts, strict=True):
        left[:, list(candidate.member.rows)] -= candidate.filtered[run][part] @ values[part_of]
    return left
