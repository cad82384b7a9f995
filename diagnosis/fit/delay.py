"""A delay of all torques, or how late a log has them, found by shifting them back: exact at any size.

A column that is linear in the delay holds near the size and at the parameters it was taken at; a delay that
makes the controller shake bends those until nothing is identifiable. Shifted back, torque is linear in all
else.
"""

from collections.abc import Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from testbench.effects import effect
from testbench.torque_lag import IN_TIME, TorqueLag, with_derivatives

from ..model.candidate import DELAY
from ..model.hypothesis import Design, bounds, design, log_prior, scaled_precision
from .bounded import solve
from .normal_equations import Fit, log_of_squares

Array = NDArray[np.float64]

# Seconds: steps of what is tried, and how late a log may have its torque.
STEP, LATEST = 0.003, 0.1
DELAYS = np.arange(0.0, effect(DELAY).DESCRIPTION.parameter("delay").upper, STEP)
# Seconds by which a log may have its torque late, and time constants of a low-pass's corner; its orders.
TIMES, ORDERS = np.arange(STEP, LATEST, STEP), (1, 2)
# How much likelier than a time alone, an independent sample: real ones by .3 and more, a mean over 40 ms,
# which is neither, by .12.
PASSED = 0.2


def likeliest_delay(hypothesis: Design, fitted: Fit) -> tuple[float, Array]:
    """The likeliest common delay, s, of a hypothesis, and all parameters (p,) fitted with it.

    hypothesis: with the delay as one of its effects, or without.
    """
    shifted = _Shifted(hypothesis, fitted)
    delay = shifted.likeliest(DELAYS, 0.0, np.inf)
    values = shifted.fit(delay)[1]
    for each, own in zip(hypothesis.accepted, hypothesis.parts, strict=True):
        if each.is_common_delay:
            values = np.insert(values, own.start, delay)
    return delay, values


def likeliest_lateness(hypothesis: Design, fitted: Fit, surely: float) -> TorqueLag:
    """Lateness of all logged torque under a hypothesis; none unless it is so much likelier.

    surely: log-likelihood, against no delay or any. No drive acts before its command: this is of the way the
    logs were taken. Through a low-pass only where that is far likelier than by a time alone.
    """
    shifted = _Shifted(hypothesis, fitted)
    late = -shifted.likeliest(-TIMES, -np.inf, 0.0)
    most = shifted.fit(-late)[0]
    if most < max(shifted.fit(delay)[0] for delay in DELAYS.tolist()) + surely:
        return IN_TIME
    through, likelihood = max(map(shifted.likeliest_low_pass, ORDERS), key=lambda found: found[1])
    is_passed = likelihood > most + PASSED * float(hypothesis.independent.sum())
    return through if is_passed else TorqueLag(delay=late)


class _Shifted:
    """The hypothesis without its delay, ready to be fitted to the torques shifted back by any."""

    def __init__(self, hypothesis: Design, fitted: Fit):
        rest = [each for each in hypothesis.accepted if not each.is_common_delay]
        self.hypothesis = design(hypothesis.base, rest, is_delayed=True)
        self.base, self.weights = hypothesis.base, fitted.weights
        products = self.hypothesis.weighted(self.weights)[0].sum(axis=0)
        self.matrix = products + np.diag(scaled_precision(self.hypothesis, fitted.prior_scales))
        self.lower, self.upper = bounds(self.hypothesis)
        self.xy = np.sum([self._products(run, left) for run, left in enumerate(self.base.gap)], axis=0)
        self.known: dict[tuple[int, int], tuple[Array, Array]] = {}

    def likeliest(self, tried: Array, least: float, most: float) -> float:
        """The likeliest delay, s, near the likeliest of those that are tried, from the least to the most."""
        nearest = tried[np.argmax([self.fit(delay)[0] for delay in tried.tolist()])]
        bounds = max(nearest - STEP, least), min(nearest + STEP, most)
        found = minimize_scalar(lambda delay: -self.fit(delay)[0], bounds=bounds, method="bounded")
        return float(found.x)

    def fit(self, delay: float) -> tuple[float, Array]:
        """Log-likelihood up to a constant, and the unknowns (p,)."""
        parts = []
        for run, each in enumerate(self.base.prepared.runs):
            whole, share = divmod(delay * each.logged.sample_rate, 1)
            # Between two samples the torque is a line, and so is all that is linear in it.
            one, other = self._moved(run, int(whole)), self._moved(run, int(whole) + 1)
            parts.append([(1 - share, *one), (share, *other)])
        return self._fit(parts)

    def likeliest_low_pass(self, order: int) -> tuple[TorqueLag, float]:
        """The low-pass of an order that is likeliest near those that are tried; its log-likelihood."""
        gains = [self.through(TorqueLag(0.0, order, constant))[0] for constant in TIMES.tolist()]
        nearest = float(TIMES[np.argmax(gains)])
        found = minimize_scalar(
            lambda constant: -self.through(TorqueLag(0.0, order, constant))[0],
            bounds=(nearest - STEP, nearest + STEP),
            method="bounded",
        )
        return TorqueLag(0.0, order, float(found.x)), -float(found.fun)

    def through(self, lag: TorqueLag) -> tuple[float, Array]:
        """Log-likelihood up to a constant, and the unknowns (p,), if the torque has passed a low-pass."""
        return self._fit(
            [
                [(weight, *part) for weight, part in zip(lag.weights, each, strict=True)]
                for each in self._derivatives
            ]
        )

    @cached_property
    def _derivatives(self) -> list[list[tuple[Array, Array]]]:
        """The first two derivatives of each run's torque, filtered (M, n), and X' of each, (n, p)."""
        found = []
        for run, each in enumerate(self.base.prepared.runs):
            _, *raw = with_derivatives(each.logged.tau, each.logged.sample_rate)
            filtered = [each.filtered(of, range(self.base.joints)) for of in raw]
            found.append([(moved, self._products(run, moved)) for moved in filtered])
        return found

    def _fit(self, parts: Sequence[Sequence[tuple[float, Array, Array]]]) -> tuple[float, Array]:
        """Log-likelihood up to a constant, and the unknowns (p,).

        parts: of a run, what is added to its torque: how many times, what (M, n) and X' of it (n, p).
        """
        base, gap, xy = self.base, [], self.xy
        for left, of_run in zip(base.gap, parts, strict=True):
            for times, moved, products in of_run:
                left, xy = left + times * moved, xy + times * products
            gap.append(left)
        values = solve(self.matrix, self.weights @ xy, self.lower, self.upper)
        squares = np.zeros(base.joints)
        for fold, y in enumerate(base.rows(gap)):
            for joint, own in enumerate(self.hypothesis.loading):
                squares[joint] += np.sum((y[joint] - self.hypothesis.x(fold, joint) @ values[own]) ** 2)
        likelihood = log_of_squares(self.hypothesis.independent, squares)
        return likelihood + float(log_prior(self.hypothesis, values)), values

    def _moved(self, run: int, samples: int) -> tuple[Array, Array]:
        """Change of a run's filtered torque, (M, n) N·m, by a shift of whole samples; its products, (n, p).

        The products are X'y with the regressor X. The first sample is held, or the last.
        """
        if (run, samples) not in self.known:
            each = self.base.prepared.runs[run]
            place = np.clip(np.arange(each.logged.samples) - samples, 0, each.logged.samples - 1)
            torque = each.logged.tau[place]
            moved = each.filtered(torque - each.logged.tau, range(self.base.joints))
            self.known[run, samples] = moved, self._products(run, moved)
        return self.known[run, samples]

    def _products(self, run: int, torque: Array) -> Array:
        """X'y of a run's torque (M, n), by joint (n, p)."""
        own = [fold for fold, (of_run, _) in enumerate(self.base.folds) if of_run == run]
        y = {fold: [torque[rows, j] for j, rows in enumerate(self.base.used[fold])] for fold in own}
        return self.hypothesis.products(y).sum(axis=0)
