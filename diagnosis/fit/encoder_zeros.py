"""Zeros of joints that lie degrees off, found by counting positions from elsewhere: exact at any size.

The derivative of the load by a position holds near a small offset and at parameters that are not bent by a
large one. Counted from the right zero, torque is linear in all parameters again, and those near the model's.
"""

from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from identification.regressor import regressor
from testbench.effects import effect

from ..model.candidate import ZERO
from ..model.hypothesis import Design, log_prior, scaled_precision
from .normal_equations import Fit, log_of_squares

Array = NDArray[np.float64]

# rad: the derivative of the load by a zero holds up to so much of it; farther ones are tried in such steps.
FAR_OFF = 0.03
OFFSETS = np.arange(FAR_OFF, effect(ZERO).DESCRIPTION.parameter("offset").upper, FAR_OFF)
# Log-posterior that counting from elsewhere must add.
SURELY = 14.0
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
    if not hinges:
        return None
    before = counted.fit(hinges[0], 0.0)[0]
    joint, way = max(product(hinges, (-1, 1)), key=lambda each: counted.fit(each[0], each[1] * FAR_OFF)[0])
    offset, likelihood = counted.likeliest(joint, way)
    if likelihood - before < SURELY or abs(offset) < FAR_OFF:
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

    def likeliest(self, joint: int, way: int) -> tuple[float, float]:
        """The offset of a joint that way that is likeliest, rad, and its log-posterior."""
        nearest = max((way * OFFSETS).tolist(), key=lambda offset: self.fit(joint, offset)[0])
        found = minimize_scalar(
            lambda offset: -self.fit(joint, offset)[0],
            bounds=(nearest - FAR_OFF, nearest + FAR_OFF),
            method="bounded",
        )
        return float(found.x), -float(found.fun)

    def _rows(self, q: Array) -> Array:
        """The standard regressor (K, n, 14 links) at these positions."""
        return regressor(self.chain, q, self.dq, self.ddq)
