"""Zeros of joints that lie degrees off, found by counting positions from elsewhere: exact at any size.

The derivative of the load by a position holds near a small offset and at parameters that are not bent by a
large one. Counted from the right zero, torque is linear in all parameters again, and those near the model's.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from identification.regressor import regressor

from ..model.hypothesis import Design, log_prior, scaled_precision
from .normal_equations import Fit, log_of_squares

Array = NDArray[np.float64]

# rad: offsets that are tried first, both ways; those that are tried where they gain; how near the likeliest
# is found; and what its derivative says as well.
FIRST, FURTHER = np.deg2rad(3), np.deg2rad([6, 11, 16, 22, 28])
TOLERANCE, LEAST = 1e-3, 0.03
# Log-posterior that counting from elsewhere must add, and the share of the most that a joint must at first.
SURELY, AS_MUCH = 14.0, 0.3
# Samples that are looked at, evenly spread over all runs.
MOST = 800


@dataclass(frozen=True)
class Zero:
    """A joint, by how much its positions are larger in the logs than in the model, rad; all unknowns (p,)."""

    joint: int
    offset: float
    values: Array


def likeliest_zero(hypothesis: Design, fitted: Fit) -> Zero | None:
    """The zero that lies surely elsewhere, of one hinge; None where no joint's does.

    hypothesis: re-identification alone.
    """
    counted = _Counted(hypothesis, fitted)
    hinges = np.flatnonzero(~hypothesis.prepared.robot.chain.is_slide).tolist()
    before = counted.fit(hinges[0], 0.0)[0] if hinges else 0.0
    first = {(j, way): counted.fit(j, way * FIRST)[0] - before for j in hinges for way in (-1, 1)}
    most = max(first.values(), default=0.0)
    if most <= 0:
        return None
    found = [counted.likeliest(*place) for place, gain in first.items() if gain > AS_MUCH * most]
    joint, offset, likelihood = max(found, key=lambda each: each[2])
    if likelihood - before < SURELY or abs(offset) < LEAST:
        return None
    return Zero(joint, offset, counted.fit(joint, offset)[1])


class _Counted:
    """Re-identification of thinned runs, with a joint's positions counted from elsewhere."""

    def __init__(self, hypothesis: Design, fitted: Fit):
        prepared, base = hypothesis.prepared, hypothesis.base
        self.hypothesis, self.chain = hypothesis, prepared.robot.chain.without_springs()
        every = prepared.evenly(MOST)
        self.q, self.dq, self.ddq, self.used = prepared.thinned(every, "q", "dq", "ddq", "used")
        self.gap = np.concatenate([gap[::every] for gap in base.gap])
        self.columns = [
            np.concatenate(
                [base.columns(run, joint, slice(None, None, every)) for run in range(len(prepared.runs))]
            )
            for joint in range(base.joints)
        ]
        self.rows = self._rows(self.q)
        self.loading, self.weights = base.loading, every * fitted.weights
        self.prior = np.diag(scaled_precision(hypothesis, fitted.prior_scales))

    def fit(self, joint: int, offset: float) -> tuple[float, Array]:
        """Log-posterior up to a constant, and the unknowns (p,)."""
        moved = self._rows(self.q - offset * np.eye(self.chain.joints)[joint]) - self.rows
        gap = self.gap - moved @ self.hypothesis.prepared.nominal
        matrix, right, parts = self.prior.copy(), np.zeros(len(self.prior)), []
        for j, (own, weight) in enumerate(zip(self.loading, self.weights, strict=True)):
            x = self.columns[j].copy()
            # All but the timing error, which comes last.
            x[:, :-1] += moved[:, j, own[:-1]]
            x, y = x[self.used[:, j]], gap[self.used[:, j], j]
            matrix[own[:, None], own] += weight * (x.T @ x)
            right[own] += weight * (x.T @ y)
            parts.append((x, y))
        values = np.asarray(np.linalg.solve(matrix, right), np.float64)
        squares = [
            float(np.sum((y - x @ values[own]) ** 2)) for (x, y), own in zip(parts, self.loading, strict=True)
        ]
        likelihood = log_of_squares(self.hypothesis.independent, np.array(squares))
        return likelihood + float(log_prior(self.hypothesis, values)), values

    def likeliest(self, joint: int, way: int) -> tuple[int, float, float]:
        """A joint, the offset that way that is likeliest, rad, and its log-posterior."""
        tried = [0.0, *(way * angle for angle in (FIRST, *FURTHER))]
        gains = [self.fit(joint, offset)[0] for offset in tried]
        best = int(np.argmax(gains))
        around = tried[max(best - 1, 0)], tried[min(best + 1, len(tried) - 1)]
        found = minimize_scalar(
            lambda offset: -self.fit(joint, offset)[0],
            bounds=(min(around), max(around)),
            method="bounded",
            options={"xatol": TOLERANCE},
        )
        return joint, float(found.x), -float(found.fun)

    def _rows(self, q: Array) -> Array:
        """The standard regressor (K, n, 14 links) at these positions."""
        return regressor(self.chain, q, self.dq, self.ddq)
