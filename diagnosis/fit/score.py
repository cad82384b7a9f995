"""Gain in likelihood of every candidate effect over a fitted hypothesis, by the Schur complement.

Nothing needs the stacked rows twice: the columns of all candidates are multiplied once with the base
regressor, a fold and a joint at a time, and every later hypothesis adds only its own few columns.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from ..model.base_regressor import BaseRegressor
from ..model.candidate import Candidate
from ..model.gram import Bank
from ..model.hypothesis import Design, design, log_prior, scaled_precision
from .active_set import Inverse, at_bounds
from .bounded import minimisers, solve
from .normal_equations import Fit, fit, fitted_to, squares

Array = NDArray[np.float64]

# Of a free function, relative to its columns before anything is projected out: what the base regressor all
# but spans, and what other runs hardly visit, is left alone.
FREE_RIDGE = 0.02


@dataclass(frozen=True)
class Gain:
    """Improvement of a fitted hypothesis by the columns of one candidate effect.

    objective: drop of the objective, chi-squared units. held_out: (n,) drop of the held-out squared
    residual of each joint, N²·m². coefficients: (k,). overlap: the largest share of any of the
    candidate's directions that the hypothesis already spans. prior: log-prior of the parameters once the
    candidate is in. information: (k, k) information matrix of the coefficients.
    """

    candidate: Candidate
    objective: float
    held_out: Array
    coefficients: Array
    overlap: float
    prior: float
    information: Array

    @property
    def wald(self) -> float:
        """Wald's statistic of the coefficients: (k,) squared standard deviations from zero, summed."""
        return float(self.coefficients @ self.information @ self.coefficients)


class Stage:
    """A fitted hypothesis, ready to weigh candidates."""

    def __init__(self, hypothesis: Design, fitted: Fit):
        self.base, self.hypothesis, self.fitted = hypothesis.base, hypothesis, fitted
        self.prepared, self.weights = hypothesis.prepared, fitted.weights
        self.residual, self.held = (self.base.rows(each) for each in (fitted.residual, fitted.held_out))
        self.xx, self.xy = hypothesis.xx, hypothesis.xy
        self.parts = hypothesis.weighted(self.weights)[0]
        self.precision = np.diag(scaled_precision(hypothesis, fitted.prior_scales))
        self.total = self.parts.sum(axis=0) + self.precision
        self.xh, falls = (hypothesis.products(dict(enumerate(of))) for of in (self.held, self.residual))
        folds_falls = np.einsum("j,fjp->fp", self.weights, falls)
        # Half of how fast the objective falls with each unknown: zero but for what is at a bound.
        self.falls = folds_falls.sum(axis=0) - self.precision @ fitted.values
        # What is at a bound moves with no candidate.
        self.whole = Inverse(self.total, at_bounds(fitted.values, fitted.bounds))
        held_back = np.where(self.whole.fixed, self.falls, 0.0)
        self.apart, shifts = [], []
        for part, own, values in zip(self.parts, folds_falls, fitted.apart, strict=True):
            apart = Inverse(self.total - part, at_bounds(values, fitted.bounds))
            moved = np.where(apart.fixed, values - fitted.values, 0.0)
            # At the minimum over all folds, the other folds' gradient is minus this fold's own.
            self.apart.append(apart)
            shifts.append(moved + apart.times(held_back - own - (self.total - part) @ moved))
        self.shift = np.array(shifts)
        self.held_squares: Array = np.sum([[np.sum(part**2) for part in fold] for fold in self.held], axis=0)
        self.counts, self.independent = hypothesis.counts, hypothesis.independent
        self._weighed: WeakKeyDictionary[Bank, list[Gain | None]] = WeakKeyDictionary()

    @classmethod
    def of(cls, base: BaseRegressor, accepted: Sequence[Candidate]) -> "Stage":
        """The hypothesis with these effects, fitted in full."""
        return cls(*fitted_to(base, accepted))

    def with_effects(self, more: Sequence[Candidate]) -> tuple[Design, Fit]:
        """The hypothesis with more effects, fitted in full."""
        return fitted_to(self.base, [*self.hypothesis.accepted, *more])

    def compared(self, candidate: Candidate) -> tuple[Design, Fit]:
        """The hypothesis with one more effect, by the weights and the prior scale of this one."""
        hypothesis = design(self.base, [*self.hypothesis.accepted, candidate])
        return hypothesis, fit(hypothesis, like=self.fitted)

    @property
    def timing(self) -> float:
        """Fitted common timing error of all torque, s, besides the hypothesis's effects."""
        return float(self.fitted.values[self.hypothesis.timing])

    @property
    def prior(self) -> float:
        """Log-prior of the hypothesis's parameters."""
        return float(log_prior(self.hypothesis, self.fitted.values))

    def shares(self, gain: Gain) -> Array:
        """Share of each joint's held-out squared residual that a candidate removes, (n,)."""
        return np.clip(gain.held_out / np.maximum(self.held_squares, 1e-300), -1.0, 0.9999)

    def removed(self, gain: Gain) -> Array:
        """RMS torque that a candidate takes off each joint's held-out residual, (n,) N·m."""
        return np.sqrt(np.maximum(gain.held_out, 0) / np.maximum(self.counts, 1))

    def as_fitted(self, gain: Gain, trial: tuple[Design, Fit]) -> Gain:
        """A candidate's gain as the hypothesis with it, fitted in full, has it: by weights of its own."""
        hypothesis, fitted = trial
        held_out = self.held_squares - squares(fitted.held_out)
        return replace(gain, held_out=held_out, prior=float(log_prior(hypothesis, fitted.values)))

    def gain(self, candidate: Candidate) -> Gain | None:
        """Gain of one candidate; None where its columns are zero on these runs."""
        return self.gains(Bank(self.base, [candidate]))[0]

    def exactly(self, candidate: Candidate) -> tuple[float, Array] | None:
        """The drop of the objective, and the candidate's coefficients (k,), with all unknowns within bounds.

        What is at a bound without it may leave it. None where its columns are zero on these runs.
        """
        bank = Bank(self.base, [candidate])
        sums = self._sums(bank)
        own = np.einsum("j,fjab->ab", self.weights, bank.squares[0][0])
        if not np.any(np.diag(own) > 0):
            return None
        cross, values = sums.cross.sum(axis=0), self.fitted.values
        matrix = np.block([[self.total, cross.T], [cross, own]])
        right = np.concatenate([self.falls, sums.right.sum(axis=0)])
        lower, upper = (
            np.concatenate([bound - values, own])
            for bound, own in zip(self.fitted.bounds, candidate.bounds, strict=True)
        )
        moved = solve(matrix, right, lower, upper)
        return float(moved @ (2 * right - matrix @ moved)), moved[len(values) :]

    def gains(self, bank: Bank) -> list[Gain | None]:
        """Gain of each candidate of the bank; None where its columns are zero on these runs."""
        if bank not in self._weighed:
            self._weighed[bank] = self._gains(bank)
        return self._weighed[bank]

    def _gains(self, bank: Bank) -> list[Gain | None]:
        sums = self._sums(bank)
        total_cross, total_right = sums.cross.sum(axis=0), sums.right.sum(axis=0)
        through = self.whole.times(total_cross.T)
        rest_cross = total_cross - sums.cross
        through_apart = np.stack([a.times(c.T) for a, c in zip(self.apart, rest_cross, strict=True)])
        wanted = total_right - sums.right - (rest_cross @ self.shift[:, :, None])[:, :, 0]
        coefficients, apart = np.zeros(len(bank.owner)), np.zeros(sums.right.shape)
        own_held = np.zeros((len(bank.candidates), self.prepared.joints))
        solved: dict[int, tuple[float, float, Array]] = {}
        for members, own_squares in zip(bank.groups, bank.squares, strict=True):
            live, size = self._live(bank, members, own_squares)
            members, own_squares, size = members[live], own_squares[live], size[live]
            if not len(members):
                continue
            k = own_squares.shape[-1]
            at = bank.start[members][:, None] + np.arange(k)
            by_fold = np.einsum("j,cfjab->cfab", self.weights, own_squares)
            own = by_fold.sum(axis=1)
            own[:, range(k), range(k)] = size
            chosen = [bank.candidates[c] for c in members]
            bounds = [np.array(of_side) for of_side in zip(*(c.bounds for c in chosen), strict=True)]
            free = np.array([c.is_free for c in chosen])
            held_back = FREE_RIDGE * free[:, None] * size + np.array([c.precision for c in chosen])
            ridge = held_back[:, :, None] * np.eye(k)
            schur = own - _products(total_cross, through, at)
            root = np.sqrt(size)
            normed = schur / (root[:, :, None] * root[:, None, :])
            remaining = np.linalg.eigvalsh((normed + normed.transpose(0, 2, 1)) / 2)
            # The hypothesis's own gradient vanishes at its minimum: Z'r alone drives the coefficients.
            c = coefficients[at] = minimisers(schur + ridge, total_right[at], size, *bounds)
            objective = 2 * np.einsum("ca,ca->c", total_right[at], c)
            objective -= np.einsum("ca,cab,cb->c", c, schur, c)
            solved.update(
                zip(members.tolist(), zip(objective, 1 - remaining[:, 0], schur, strict=True), strict=True)
            )
            # Without each fold in turn, all of them at once.
            rest = own - by_fold.transpose(1, 0, 2, 3)
            part = rest - _products(rest_cross, through_apart, at) + ridge
            repeated = (np.tile(each, (len(part), 1)) for each in (size, *bounds))
            c = minimisers(part.reshape(-1, k, k), wanted[:, at].reshape(-1, k), *repeated)
            c = c.reshape(len(part), -1, k)
            # A coefficient that the other folds do not reach cannot be predicted from them.
            unreached = np.any(np.einsum("fcaa->fca", rest) <= 1e-9 * size, axis=2)
            c[unreached & ~free] = 0.0
            apart[:, at] = c
            for f, left_out in enumerate(c):
                own_held[members] -= np.einsum("ca,cjab,cb->cj", left_out, own_squares[:, f], left_out)
        held_out = own_held + self._held_out_by_moving(bank, sums, through_apart, apart)
        return self._listed(bank, through, coefficients, held_out, solved)

    def _listed(
        self,
        bank: Bank,
        through: Array,
        coefficients: Array,
        held_out: Array,
        solved: dict[int, tuple[float, float, Array]],
    ) -> list[Gain | None]:
        """The gains of those candidates that were solved, in the bank's order; None for the others."""
        values = np.repeat(self.fitted.values[:, None], len(bank.candidates), axis=1)
        np.add.at(values.T, bank.owner, -(through * coefficients).T)
        prior = log_prior(self.hypothesis, values)
        found: list[Gain | None] = [None] * len(bank.candidates)
        for index, (drop, overlap, information) in solved.items():
            found[index] = Gain(
                candidate=bank.candidates[index],
                objective=float(drop),
                held_out=held_out[index],
                coefficients=coefficients[bank.start[index] : bank.start[index + 1]],
                overlap=float(overlap),
                prior=float(prior[index]),
                information=information,
            )
        return found

    def _sums(self, bank: Bank) -> "_Sums":
        folds, p, columns = range(len(self.residual)), len(self.hypothesis.precision), len(bank.owner)
        sums = _Sums(np.zeros((len(folds), columns, p)), np.zeros((len(folds), columns)), {}, {})
        for f, j in product(folds, bank.joints):
            z, at, weight = bank.z(f, j), bank.reached[j], self.weights[j]
            with_x = np.concatenate([bank.zx[f][j], z.T @ self.hypothesis.added[f][j]], axis=1)
            sums.with_x[f, j], sums.with_held[f, j] = with_x, z.T @ self.held[f][j]
            sums.cross[f, at[:, None], self.hypothesis.loading[j]] += weight * with_x
            sums.right[f, at] += weight * (z.T @ self.residual[f][j])
        return sums

    def _live(
        self, bank: Bank, members: NDArray[np.int64], squares: Array
    ) -> tuple[NDArray[np.bool_], Array]:
        """Mask (C,) of a group's candidates that show at all; weighted squares of their columns (C, k)."""
        size = np.einsum("j,cfjaa->ca", self.weights, squares)
        # A window of an event may fall where nothing counts, and what no joint feels is held at zero; the
        # others still count.
        event = np.array([bank.candidates[c].is_event for c in members])
        held = np.array([bank.candidates[c].member.upper == bank.candidates[c].member.lower for c in members])
        live = np.all((size > 0) | held | event[:, None], axis=1) & np.any(size > 0, axis=1)
        return live, np.where(size == 0, 1.0, size)

    def _held_out_by_moving(self, bank: Bank, sums: "_Sums", through_apart: Array, apart: Array) -> Array:
        """Drop of the held-out squares (C, n) but for each candidate's own: the parameters move with it."""
        count = len(bank.candidates)
        drop = np.zeros((count, self.prepared.joints))
        for f, through in enumerate(through_apart):
            moved = np.zeros((len(self.hypothesis.precision), count))
            np.add.at(moved.T, bank.owner, -(through * apart[f]).T)
            for j, loading in enumerate(self.hypothesis.loading):
                own, xx = moved[loading], self.xx[f][j]
                drop[:, j] += 2 * (self.xh[f, j, loading] @ own) - np.sum(own * (xx @ own), axis=0)
                if not len(at := bank.reached[j]):
                    continue
                owner = bank.owner[at]
                meet = sums.with_held[f, j] - np.einsum("ku,uk->k", sums.with_x[f, j], own[:, owner])
                drop[:, j] += np.bincount(owner, 2 * apart[f, at] * meet, minlength=count)
        return drop


@dataclass(frozen=True)
class _Sums:
    """Products of a bank's columns: with the hypothesis's and its residual, weighted, by fold; and by joint.

    cross: (F, K, p). right: (F, K). with_x, with_held: by fold and joint, (K_j, u) and (K_j,), unweighted, of
    the u unknowns that load it.
    """

    cross: Array
    right: Array
    with_x: dict[tuple[int, int], Array]
    with_held: dict[tuple[int, int], Array]


def _products(cross: Array, through: Array, at: NDArray[np.int64]) -> Array:
    """cross[at] @ through[:, at] for each candidate's columns: (..., C, k, k)."""
    reached = np.swapaxes(through, -1, -2)[..., at, :]
    return cross[..., at, :] @ np.swapaxes(reached, -1, -2)
