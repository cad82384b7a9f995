"""Normal equations of a hypothesis, fold by fold and joint by joint, and what a candidate adds to them.

Unknowns are the deviations of the standard parameters from the model's, held back by the prior of
prior.py, a common timing error, and the coefficients of the effects taken in so far. Rows are
weighted with one over each joint's long-run residual variance, so that squared sums are in units of
chi-squared for coloured residuals too.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

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
    residual: a run, (M, n) N·m, zero where unused. held_out: likewise, each fold predicted from the others.
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
        weights = 1 / np.maximum(variance * inflation, 1e-30)
        distance = float(values**2 @ hypothesis.precision)
        prior_scale = 1.0 + distance / count
    information = np.einsum("j,fjab->ab", weights, normal.xx)
    information[np.diag_indices_from(information)] += hypothesis.precision / prior_scale + RIDGE
    values = _values(normal, hypothesis, weights, prior_scale, lower, upper)
    residual = _residual(hypothesis, values)
    distance = float(values**2 @ hypothesis.precision) / prior_scale
    held_out = [np.zeros_like(gap) for gap in hypothesis.gap]
    for fold, (run, part) in enumerate(prepared.folds):
        rest = [other for other in range(len(prepared.folds)) if other != fold]
        apart = _values(normal, hypothesis, weights, prior_scale, lower, upper, rest)
        held_out[run][part] = _residual(hypothesis, apart)[run][part]
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


@dataclass(frozen=True)
class Gain:
    """What a candidate adds to a fitted hypothesis.

    objective: drop of the objective, chi-squared units. held_out: (n,) drop of the held-out squared
    residual of each joint, N²·m². coefficients: (k,). overlap: the largest share of any of the
    candidate's directions that the hypothesis already spans.
    """

    candidate: Candidate
    objective: float
    held_out: Array
    coefficients: Array
    overlap: float


class Stage:
    """A fitted hypothesis, ready to weigh candidates one by one by the Schur complement."""

    def __init__(self, prepared: Prepared, hypothesis: Design, fitted: Fit):
        n = prepared.joints
        self.prepared, self.hypothesis, self.fitted = prepared, hypothesis, fitted
        self.weights = fitted.weights
        self.used = [
            [np.flatnonzero(hypothesis.used[run][part, j]) + part.start for j in range(n)]
            for run, part in prepared.folds
        ]
        self.x = self._rows(hypothesis.columns)
        residual = self._rows(fitted.residual)
        self.residual, self.held = residual, self._rows(fitted.held_out)
        own = [sum(self.weights[j] * x.T @ x for j, x in enumerate(fold)) for fold in self.x]
        total = sum(own) + np.diag(hypothesis.precision / fitted.prior_scale)
        self.whole = _Inverse(total)
        self.apart = [_Inverse(total - part) for part in own]
        # At the minimum over all folds, the other folds' gradient is minus this fold's own.
        self.shift = [
            apart.times(-sum(self.weights[j] * x.T @ residual[f][j] for j, x in enumerate(self.x[f])))
            for f, apart in enumerate(self.apart)
        ]
        self.held_squares = sum(np.array([float(np.sum(part**2)) for part in fold]) for fold in self.held)
        self.counts = sum(np.array([len(part) for part in fold]) for fold in self.held)

    @cached_property
    def effective_samples(self) -> Array:
        """Independent samples a joint that a misfit of this colour holds, (n,)."""
        _, inflation = variance_inflation(self.fitted.residual, self.hypothesis.used)
        return self.counts / inflation

    def _rows(self, runs: Sequence[Array]) -> list[list[Array]]:
        """Used rows of each fold and joint."""
        return [
            [runs[run][index, j] for j, index in enumerate(self.used[f])]
            for f, (run, _) in enumerate(self.prepared.folds)
        ]

    def gain(self, candidate: Candidate) -> Gain | None:
        """What the candidate adds; None where its columns are zero on these runs."""
        weights, reached = self.weights, sorted(candidate.member.rows)
        z = [
            {j: candidate.columns[run][self.used[f][j], j] for j in reached}
            for f, (run, _) in enumerate(self.prepared.folds)
        ]
        folds = range(len(z))
        zz = [sum(weights[j] * z[f][j].T @ z[f][j] for j in reached) for f in folds]
        zx = [sum(weights[j] * z[f][j].T @ self.x[f][j] for j in reached) for f in folds]
        zr = [sum(weights[j] * z[f][j].T @ self.residual[f][j] for j in reached) for f in folds]
        own, cross, right = sum(zz), sum(zx), sum(zr)
        size = np.diag(own)
        if np.any(size <= 0):
            return None
        lower, upper = candidate.member.lower, candidate.member.upper
        schur = own - cross @ self.whole.times(cross.T)
        remaining = np.linalg.eigvalsh(schur / np.sqrt(np.outer(size, size)))
        # The hypothesis's own gradient vanishes at its minimum: Z'r alone drives the coefficients.
        coefficients = _small(schur, right, lower, upper)
        held_out = np.zeros(self.prepared.joints)
        for f in folds:
            rest, rest_cross = own - zz[f], cross - zx[f]
            if np.any(np.diag(rest) <= 1e-9 * size):
                continue
            part = rest - rest_cross @ self.apart[f].times(rest_cross.T)
            c = _small(part, right - zr[f] - rest_cross @ self.shift[f], lower, upper)
            moved = -self.apart[f].times(rest_cross.T @ c)
            for j in range(self.prepared.joints):
                change = self.x[f][j] @ moved
                if j in z[f]:
                    change = change + z[f][j] @ c
                held_out[j] += float(2 * change @ self.held[f][j] - change @ change)
        return Gain(
            candidate=candidate,
            objective=float(2 * right @ coefficients - coefficients @ schur @ coefficients),
            held_out=held_out,
            coefficients=coefficients,
            overlap=float(1 - remaining[0]),
        )


def _small(matrix: Array, right: Array, lower: Array, upper: Array) -> Array:
    """As ``solve`` for a candidate's few coefficients, regularised against exact collinearity."""
    scale = np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    scaled = matrix / np.outer(scale, scale) + 1e-9 * np.eye(len(right))
    free = np.linalg.solve(scaled, right / scale) / scale
    if np.all(free >= lower) and np.all(free <= upper):
        return free
    root = np.linalg.cholesky(scaled + 1e-9 * np.eye(len(right)))
    target = np.linalg.solve(root, right / scale)
    bounded = lsq_linear(root.T, target, bounds=(lower * scale, upper * scale), method="bvls")
    return bounded.x / scale


class _Inverse:
    """Products with the inverse of a symmetric positive definite matrix, scaled against its units."""

    def __init__(self, matrix: Array):
        diagonal = np.diag(matrix)
        self.scale = 1 / np.sqrt(np.where(diagonal > 0, diagonal, 1.0))
        scaled = matrix * np.outer(self.scale, self.scale)
        scaled[np.diag_indices_from(scaled)] += RIDGE
        self.factor = cho_factor(scaled, lower=True)

    def times(self, right: Array) -> Array:
        """Inverse times right, (p,) or (p, k)."""
        scale = self.scale if right.ndim == 1 else self.scale[:, None]
        return scale * cho_solve(self.factor, scale * right)
