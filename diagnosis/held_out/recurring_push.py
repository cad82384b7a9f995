"""A push that comes in every run alike, so that each run predicts it in the others."""

from collections.abc import Sequence
from operator import itemgetter

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from testbench.effects.push import ABRUPT, BELL, KINDS, common_times, narrowed

from ..fit.normal_equations import Fit
from ..model.candidate import Candidate
from ..model.candidates import candidate
from ..model.hypothesis import Design
from .recurrence import Recurrence

Array = NDArray[np.float64]

# Share of the push in each run that the other runs must predict.
PREDICTED = 0.7
# Of the columns' squares, against loads that these runs do not distinguish.
RIDGE = 1e-4
REFINEMENTS, STEP = 30, 0.02


def recurrence(hypothesis: Design, fitted: Fit) -> Recurrence | None:
    """The push of a hypothesis as one that every run has at the same time; None where the runs differ.

    Judged by leaving each run out: the others must predict its push.
    """
    for pushed, part in zip(hypothesis.accepted, hypothesis.parts, strict=True):
        if pushed.is_event:
            return _recurring(hypothesis, fitted, pushed, fitted.values[part])
    return None


def _recurring(hypothesis: Design, fitted: Fit, pushed: Candidate, values: Array) -> Recurrence | None:
    prepared = hypothesis.prepared
    torque = [r + columns @ values for r, columns in zip(fitted.residual, pushed.columns, strict=True)]
    shapes: list[tuple[float, dict[str, float]]] = []

    def judged(shape: dict[str, float]) -> tuple[float, Recurrence]:
        """The push of that shape, and the least share of any run's that the others predict."""
        assert pushed.family.member is not None
        made = candidate(prepared, pushed.family, pushed.family.member(shape))
        squared, right, left = _sums(hypothesis, fitted, made, torque)
        all_squared, all_right = squared.sum(axis=0), right.sum(axis=0)
        shares = [
            _share(*run, _solved(all_squared - run[0], all_right - run[1]))
            for run in zip(squared, right, left, strict=True)
        ]
        return min(shares), Recurrence(made, _solved(all_squared, all_right))

    def predicted(kind: float, stretch: float, first: float, last: float) -> float:
        shape = {"kind": kind, "stretch": stretch, "first": first, "last": last}
        shapes.append((judged(shape)[0], shape))
        return shapes[-1][0]

    for first, last in common_times([run.logged for run in prepared.runs], pushed.member.columns):
        for stretch in (ABRUPT, BELL):
            start, end = narrowed(first, last, stretch)
            if start < end:
                for kind in KINDS:
                    predicted(float(kind), stretch, start, end)
    if not shapes:
        return None
    _, best = max(shapes, key=itemgetter(0))
    ends_found = np.array([best["first"], best["last"]])

    def negative(ends: Array) -> float:
        first, last = np.sort(ends).tolist()
        return -predicted(best["kind"], best["stretch"], first, last)

    simplex = ends_found + STEP * np.array([[0, 0], [1, 0], [0, 1]])
    minimize(
        negative,
        ends_found,
        method="Nelder-Mead",
        options={"maxfev": REFINEMENTS, "initial_simplex": simplex},
    )
    share, found = judged(max(shapes, key=itemgetter(0))[1])
    return found if share > PREDICTED else None


def _sums(
    hypothesis: Design, fitted: Fit, made: Candidate, torque: Sequence[Array]
) -> tuple[Array, Array, Array]:
    """Z'Z (R, k, k), Z'y (R, k) and y'y (R,) of each run, weighted, over the samples of the push."""
    squared, right, left = [], [], []
    for run, columns, own in zip(hypothesis.prepared.runs, made.columns, torque, strict=True):
        during = columns.any(axis=(1, 2))
        used = run.used[during] * fitted.weights
        z, y = columns[during], own[during]
        squared.append(np.einsum("tja,tj,tjb->ab", z, used, z))
        right.append(np.einsum("tja,tj,tj->a", z, used, y))
        left.append(np.sum(used * y**2))
    return np.array(squared), np.array(right), np.array(left)


def _solved(squared: Array, right: Array) -> Array:
    size = np.sqrt(np.maximum(np.diag(squared), 1e-300))
    scaled = squared / np.outer(size, size) + RIDGE * np.eye(len(size))
    solved: Array = np.linalg.solve(scaled, right / size) / size
    return np.where(np.diag(squared) > 0, solved, 0.0)


def _share(squared: Array, right: Array, left: float, values: Array) -> float:
    """Share of a run's squared torque that these coefficients explain; none where it has no such sample."""
    return float(2 * values @ right - values @ squared @ values) / left if left > 0 else -np.inf
