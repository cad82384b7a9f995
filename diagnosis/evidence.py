"""Normal equations of a hypothesis, fold by fold and joint by joint, and its fit.

Unknowns are the deviations of the standard parameters from the model's, held back by the prior of
prior.py, a common timing error, and the coefficients of the effects taken in so far. Rows are
weighted with one over each joint's long-run residual variance, so that squared sums are in units of
chi-squared for coloured residuals too.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve
from scipy.optimize import lsq_linear

from identification.covariance import variance_inflation

from .candidates import Candidate
from .preparation import Prepared
from .prior import TIMING, parameter_widths

Array = NDArray[np.float64]

RIDGE = 1e-12
WEIGHT_PASSES = 3
# Misfit can be coloured without end; a joint must not lose its say altogether over it.
LARGEST_INFLATION = 10.0


@dataclass(frozen=True)
class Design:
    """The regressor of a hypothesis: a run, columns (M, n, p); gap: a run, (M, n) torque less the model's.

    precision: (p,) prior precision of each unknown, 0 for none. accepted: the effects taken in.
    """

    columns: tuple[Array, ...]
    gap: tuple[Array, ...]
    used: tuple[NDArray[np.bool_], ...]
    precision: Array
    accepted: tuple[Candidate, ...]

    @property
    def parameters(self) -> int:
        """Number of unknowns before the effects' coefficients."""
        return len(self.precision) - sum(c.count for c in self.accepted)


def design(prepared: Prepared, accepted: Sequence[Candidate] = ()) -> Design:
    """The hypothesis that these effects act, and no other."""
    torque_scale = torque_rms(prepared)
    widths = np.append(parameter_widths(prepared.nominal, torque_scale), TIMING)
    columns, gaps = [], []
    for index, run in enumerate(prepared.runs):
        timing = -run.filtered(run.logged.predicted_rate)[:, :, None]
        columns.append(np.concatenate([run.rows, timing, *(c.columns[index] for c in accepted)], axis=2))
        gaps.append(run.torque - run.rows @ prepared.nominal)
    free = np.zeros(sum(c.count for c in accepted))
    return Design(
        tuple(columns),
        tuple(gaps),
        tuple(run.used for run in prepared.runs),
        np.concatenate([widths**-2.0, free]),
        tuple(accepted),
    )


def torque_rms(prepared: Prepared) -> Array:
    """RMS torque of each joint over all runs, (n,) N·m."""
    return np.sqrt(np.mean(np.concatenate([run.torque for run in prepared.runs]) ** 2, axis=0))


@dataclass(frozen=True)
class Fit:
    """A hypothesis fitted to all folds.

    values: (p,). covariance: (p, p). weights: (n,) one over the long-run residual variance.
    objective: weighted squared residual plus prior. prior_scale: variance scale of the prior.
    residual: a run, (M, n) N·m, zero where unused. held_out: likewise, each fold predicted from the others
    but for events, which are taken off as they were.
    """

    values: Array
    covariance: Array
    weights: Array
    objective: float
    prior_scale: float
    residual: tuple[Array, ...]
    held_out: tuple[Array, ...]
    bounds: tuple[Array, Array]


class Normal:
    """Sums over each fold's used rows of one joint: X'X (F, n, p, p), X'y (F, n, p), y'y (F, n)."""

    def __init__(self, prepared: Prepared, hypothesis: Design):
        folds, n, p = len(prepared.folds), prepared.joints, len(hypothesis.precision)
        self.xx, self.xy, self.yy = np.zeros((folds, n, p, p)), np.zeros((folds, n, p)), np.zeros((folds, n))
        for fold, (run, part) in enumerate(prepared.folds):
            for joint in range(n):
                used = hypothesis.used[run][part, joint]
                x = hypothesis.columns[run][part, joint][used]
                y = hypothesis.gap[run][part, joint][used]
                self.xx[fold, joint] = x.T @ x
                self.xy[fold, joint] = x.T @ y
                self.yy[fold, joint] = y @ y


def solve(matrix: Array, right: Array, lower: Array, upper: Array) -> Array:
    """Minimiser of x'Ax/2 - b'x within bounds; A (p, p) positive definite."""
    scale = 1 / np.sqrt(np.diag(matrix))
    scaled = matrix * np.outer(scale, scale)
    scaled[np.diag_indices_from(scaled)] += RIDGE
    factor = cho_factor(scaled, lower=True)
    free = scale * cho_solve(factor, scale * right)
    if np.all(free >= lower - 1e-12 * np.abs(free)) and np.all(free <= upper + 1e-12 * np.abs(free)):
        return free
    root = np.tril(factor[0])
    target = np.linalg.solve(root, scale * right)
    found = lsq_linear(root.T, target, bounds=(lower / scale, upper / scale), method="bvls")
    return scale * found.x


def fit(prepared: Prepared, hypothesis: Design) -> Fit:
    """Weights, prior scale and values estimated in turn; then every fold predicted from the others."""
    normal = Normal(prepared, hypothesis)
    lower, upper = _bounds(hypothesis)
    weights = 1 / np.maximum(np.var(np.concatenate(hypothesis.gap), axis=0), 1e-30)
    prior_scale = 1.0
    count = determined(prepared)
    for _ in range(WEIGHT_PASSES):
        values = _values(normal, hypothesis, weights, prior_scale, lower, upper)
        residual = _residual(hypothesis, values)
        variance, inflation = variance_inflation(residual, hypothesis.used)
        weights = 1 / np.maximum(variance * np.minimum(inflation, LARGEST_INFLATION), 1e-30)
        distance = float(values**2 @ hypothesis.precision)
        prior_scale = 1.0 + distance / count
    information = np.einsum("j,fjab->ab", weights, normal.xx)
    information[np.diag_indices_from(information)] += hypothesis.precision / prior_scale + RIDGE
    values = _values(normal, hypothesis, weights, prior_scale, lower, upper)
    residual = _residual(hypothesis, values)
    events = np.concatenate(
        [np.zeros(hypothesis.parameters, bool), *(np.full(c.count, c.is_event) for c in hypothesis.accepted)]
    )
    distance = float(values**2 @ hypothesis.precision) / prior_scale
    held_out = [np.zeros_like(gap) for gap in hypothesis.gap]
    for fold, (run, part) in enumerate(prepared.folds):
        rest = [other for other in range(len(prepared.folds)) if other != fold]
        apart = _values(normal, hypothesis, weights, prior_scale, lower, upper, rest)
        # No other run foretells an event: it is told apart from what the model predicts, not predicted.
        apart[events] = values[events]
        left = hypothesis.gap[run][part] - hypothesis.columns[run][part] @ apart
        held_out[run][part] = np.where(hypothesis.used[run][part], left, 0.0)
    return Fit(
        values=values,
        covariance=np.linalg.pinv(information, hermitian=True),
        weights=weights,
        objective=sum(float(np.sum(weights * r**2)) for r in residual) + distance,
        prior_scale=prior_scale,
        residual=residual,
        held_out=tuple(held_out),
        bounds=(lower, upper),
    )


def fitted_to(prepared: Prepared, accepted: Sequence[Candidate]) -> tuple[Design, Fit]:
    """The hypothesis that these effects act, and its fit."""
    hypothesis = design(prepared, accepted)
    return hypothesis, fit(prepared, hypothesis)


def squares(residual: Sequence[Array]) -> Array:
    """Sum of squares of each joint over all runs (M, n), (n,)."""
    return np.sum([np.sum(run**2, axis=0) for run in residual], axis=0)


def prior_distance(hypothesis: Design, fitted: Fit) -> float:
    """Squared distance of a fit's parameters from the model's, in units of the prior."""
    return float(fitted.values**2 @ hypothesis.precision)


def _bounds(hypothesis: Design) -> tuple[Array, Array]:
    unbounded = np.full(hypothesis.parameters, np.inf)
    lower = np.concatenate([-unbounded, *(c.member.lower for c in hypothesis.accepted)])
    upper = np.concatenate([unbounded, *(c.member.upper for c in hypothesis.accepted)])
    return lower, upper


def determined(prepared: Prepared) -> float:
    """How many parameters the data can move: about nine of fourteen a joint."""
    return 9.0 * prepared.joints


def _values(
    normal: Normal,
    hypothesis: Design,
    weights: Array,
    prior_scale: float,
    lower: Array,
    upper: Array,
    folds: Sequence[int] | None = None,
) -> Array:
    chosen = list(range(len(normal.yy))) if folds is None else list(folds)
    matrix = np.einsum("j,fjab->ab", weights, normal.xx[chosen])
    right = np.einsum("j,fja->a", weights, normal.xy[chosen])
    matrix[np.diag_indices_from(matrix)] += hypothesis.precision / prior_scale
    # A coefficient that this fold does not reach is left at zero.
    dead = np.diag(matrix) <= 0
    matrix[dead, dead] = 1.0
    return solve(matrix, right, lower, upper)


def _residual(hypothesis: Design, values: Array) -> tuple[Array, ...]:
    return tuple(
        np.where(used, gap - columns @ values, 0.0)
        for columns, gap, used in zip(hypothesis.columns, hypothesis.gap, hypothesis.used, strict=True)
    )
