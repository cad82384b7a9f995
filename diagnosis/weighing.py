"""What every candidate would add to a fitted hypothesis, all at once, by the Schur complement.

Nothing needs the stacked rows twice: the columns of all candidates are multiplied once with the base
regressor, a fold and a joint at a time, and every later hypothesis adds only its own few columns.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve

from .candidates import Candidate
from .evidence import RIDGE, Design, Fit, Normal, log_prior, scaled_precision
from .ground import Ground

Array = NDArray[np.float64]

# Against exact collinearity within a candidate, relative.
SMALL_RIDGE = 1e-9
# Of a free function, relative to its columns before anything is projected out: what the base regressor all
# but spans, and what other runs hardly visit, is left alone.
FREE_RIDGE = 0.02
SWEEPS, CONVERGED = 500, 1e-12


@dataclass(frozen=True)
class Gain:
    """What a candidate adds to a fitted hypothesis.

    objective: drop of the objective, chi-squared units. held_out: (n,) drop of the held-out squared
    residual of each joint, N²·m². coefficients: (k,). overlap: the largest share of any of the
    candidate's directions that the hypothesis already spans. prior: log-prior of the parameters once the
    candidate is in. information: (k, k) what the runs tell of the coefficients.
    """

    candidate: Candidate
    objective: float
    held_out: Array
    coefficients: Array
    overlap: float
    prior: float
    information: Array


class Bank:
    """Candidates with the products of their columns with each other and with the base regressor.

    K columns of all candidates side by side. owner: (K,) the candidate of each. Sums are kept apart by
    fold and joint, since weights change from one hypothesis to the next.
    """

    def __init__(self, ground: Ground, proposals: Sequence[Candidate]):
        self.candidates = tuple(proposals)
        counts = np.array([c.count for c in proposals], dtype=np.int64)
        self.start = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
        self.owner = np.repeat(np.arange(len(counts)), counts)
        folds, n = range(len(ground.folds)), ground.joints
        reach = [[c for c, each in enumerate(proposals) if j in each.member.rows] for j in range(n)]
        self.reached = [np.flatnonzero(np.isin(self.owner, own)) for own in reach]
        # Columns that reach a joint, of the used rows of a fold: (m, K_j).
        self.z = [
            [
                np.concatenate([ground.rows_of(proposals[c].columns, f, j) for c in own], axis=1)
                if own
                else np.zeros((len(ground.used[f][j]), 0))
                for j, own in enumerate(reach)
            ]
            for f in folds
        ]
        self.zx = [
            [z.T @ x for z, x in zip(*both, strict=True)] for both in zip(self.z, ground.x, strict=True)
        ]
        # Candidates of the same number of coefficients are solved together.
        self.groups = [np.flatnonzero(counts == k) for k in np.unique(counts)]
        self.squares = [
            np.zeros((len(own), len(ground.folds), n, *(2 * [counts[own[0]]]))) for own in self.groups
        ]
        place = {int(c): (g, i) for g, own in enumerate(self.groups) for i, c in enumerate(own)}
        for j, own in enumerate(reach):
            at = np.searchsorted(self.reached[j], [self.start[c] for c in own])
            for c, first in zip(own, at, strict=True):
                g, i = place[c]
                part = slice(first, first + counts[c])
                for f in folds:
                    z = self.z[f][j][:, part]
                    self.squares[g][i, f, j] = z.T @ z


class Stage:
    """A fitted hypothesis, ready to weigh candidates."""

    def __init__(self, ground: Ground, hypothesis: Design, fitted: Fit):
        self.ground, self.hypothesis, self.fitted = ground, hypothesis, fitted
        self.prepared, self.weights = ground.prepared, fitted.weights
        folds, n = range(len(ground.folds)), ground.joints
        self.x, self.added = ground.x, [[np.zeros((len(x), 0)) for x in fold] for fold in ground.x]
        if hypothesis.accepted:
            self.added = ground.rows([hypothesis.added(run) for run in range(len(ground.gap))])
            self.x = [
                [np.concatenate([ground.x[f][j], self.added[f][j]], axis=1) for j in range(n)] for f in folds
            ]
        self.residual, self.held = ground.rows(fitted.residual), ground.rows(fitted.held_out)
        self.xx = Normal(hypothesis).xx
        self.xh = [
            [x.T @ h for x, h in zip(*both, strict=True)] for both in zip(self.x, self.held, strict=True)
        ]
        parts = np.einsum("j,fjab->fab", self.weights, self.xx)
        total = parts.sum(axis=0) + np.diag(scaled_precision(hypothesis, fitted.prior_scale))
        self.whole = _Inverse(total)
        self.apart = [_Inverse(total - part) for part in parts]
        # At the minimum over all folds, the other folds' gradient is minus this fold's own.
        self.shift = [
            apart.times(-sum(self.weights[j] * x.T @ self.residual[f][j] for j, x in enumerate(self.x[f])))
            for f, apart in enumerate(self.apart)
        ]
        self.held_squares: Array = np.sum([[np.sum(part**2) for part in fold] for fold in self.held], axis=0)
        self.counts: Array = np.sum([[len(part) for part in fold] for fold in self.held], axis=0)

    @property
    def prior(self) -> float:
        """Log-prior of the hypothesis's parameters."""
        return float(log_prior(self.hypothesis, self.fitted.values))

    def shares(self, gain: Gain) -> Array:
        """Share of each joint's held-out squared residual that a candidate removes, (n,)."""
        return np.clip(gain.held_out / np.maximum(self.held_squares, 1e-300), -1.0, 0.9999)

    def gain(self, candidate: Candidate) -> Gain | None:
        """What one candidate adds; None where its columns are zero on these runs."""
        return self.gains(Bank(self.ground, [candidate]))[0]

    def gains(self, bank: Bank) -> list[Gain | None]:
        """What each candidate of the bank adds; None where its columns are zero on these runs."""
        folds, n = range(len(self.x)), self.prepared.joints
        p, columns = len(self.hypothesis.precision), len(bank.owner)
        cross, right = np.zeros((len(self.x), columns, p)), np.zeros((len(self.x), columns))
        with_held: list[list[Array]] = []
        with_x: list[list[Array]] = []
        for f in folds:
            with_held.append([])
            with_x.append([])
            for j in range(n):
                z, at, weight = bank.z[f][j], bank.reached[j], self.weights[j]
                added = z.T @ self.added[f][j]
                zx = np.concatenate([bank.zx[f][j], added], axis=1)
                cross[f, at] += weight * zx
                right[f, at] += weight * (z.T @ self.residual[f][j])
                with_x[f].append(zx)
                with_held[f].append(z.T @ self.held[f][j])
        total_cross, total_right = cross.sum(axis=0), right.sum(axis=0)
        through = self.whole.times(total_cross.T)
        through_apart = [self.apart[f].times((total_cross - cross[f]).T) for f in folds]
        found: list[Gain | None] = [None] * len(bank.candidates)
        coefficients = np.zeros(columns)
        information: dict[int, Array] = {}
        objective, overlap = np.zeros(len(bank.candidates)), np.zeros(len(bank.candidates))
        apart = np.zeros((len(self.x), columns))
        own_held = np.zeros((len(bank.candidates), len(self.x), n))
        alive = []
        for members, squares in zip(bank.groups, bank.squares, strict=True):
            k = squares.shape[-1]
            at = bank.start[members][:, None] + np.arange(k)
            by_fold = np.einsum("j,cfjab->cfab", self.weights, squares)
            own = by_fold.sum(axis=1)
            size = np.einsum("caa->ca", own)
            # A window of an event may fall where nothing counts; the others still tell.
            event = np.array([bank.candidates[c].is_event for c in members])
            live = np.where(event, np.any(size > 0, axis=1), np.all(size > 0, axis=1))
            own[:, range(k), range(k)] += size == 0
            size = np.where(size == 0, 1.0, size)
            members, squares, at, by_fold, own, size = (
                part[live] for part in (members, squares, at, by_fold, own, size)
            )
            if not len(members):
                continue
            alive.append(members)
            lower = np.array([bank.candidates[c].member.lower for c in members])
            upper = np.array([bank.candidates[c].member.upper for c in members])
            free = np.array([bank.candidates[c].is_free for c in members])
            ridge = FREE_RIDGE * (free[:, None] * size)[:, :, None] * np.eye(k)
            schur = own - _products(total_cross, through, at)
            normed = schur / np.sqrt(size[:, :, None] * size[:, None, :])
            remaining = np.linalg.eigvalsh((normed + normed.transpose(0, 2, 1)) / 2)
            # The hypothesis's own gradient vanishes at its minimum: Z'r alone drives the coefficients.
            c = _bounded(schur + ridge, total_right[at], lower, upper)
            coefficients[at] = c
            objective[members] = 2 * np.einsum("ca,ca->c", total_right[at], c)
            objective[members] -= np.einsum("ca,cab,cb->c", c, schur, c)
            overlap[members] = 1 - remaining[:, 0]
            information.update(zip(members.tolist(), schur, strict=True))
            for f in folds:
                rest, rest_cross = own - by_fold[:, f], total_cross - cross[f]
                part = rest - _products(rest_cross, through_apart[f], at)
                wanted = (total_right - right[f] - rest_cross @ self.shift[f])[at]
                c = _bounded(part + ridge, wanted, lower, upper)
                # A coefficient that the other folds do not reach cannot be predicted from them.
                unreached = np.any(np.einsum("caa->ca", rest) <= 1e-9 * size, axis=1)
                c[unreached & ~free] = 0.0
                apart[f, at] = c
                own_held[members, f] = -np.einsum("ca,cjab,cb->cj", c, squares[:, f], c)
        held_out = own_held.sum(axis=1)
        for f in folds:
            moved = np.zeros((p, len(bank.candidates)))
            np.add.at(moved.T, bank.owner, -(through_apart[f] * apart[f]).T)
            for j in range(n):
                held_out[:, j] += 2 * (self.xh[f][j] @ moved)
                held_out[:, j] -= np.sum(moved * (self.xx[f][j] @ moved), axis=0)
                at = bank.reached[j]
                owner = bank.owner[at]
                meet = with_held[f][j] - np.einsum("kp,pk->k", with_x[f][j], moved[:, owner])
                held_out[:, j] += np.bincount(owner, 2 * apart[f, at] * meet, minlength=len(bank.candidates))
        values = np.repeat(self.fitted.values[:, None], len(bank.candidates), axis=1)
        np.add.at(values.T, bank.owner, -(through * coefficients).T)
        prior = log_prior(self.hypothesis, values)
        for index in (int(c) for members in alive for c in members):
            found[index] = Gain(
                candidate=bank.candidates[index],
                objective=float(objective[index]),
                held_out=held_out[index],
                coefficients=coefficients[bank.start[index] : bank.start[index + 1]],
                overlap=float(overlap[index]),
                prior=float(prior[index]),
                information=information[index],
            )
        return found


def _products(cross: Array, through: Array, at: NDArray[np.int64]) -> Array:
    """cross[at] @ through[:, at] for each candidate's columns: (C, k, k)."""
    return np.einsum("cap,cpb->cab", cross[at], through.T[at].transpose(0, 2, 1), optimize=True)


def _bounded(matrix: Array, right: Array, lower: Array, upper: Array) -> Array:
    """Minimisers (C, k) of c'Ac/2 - b'c within bounds, regularised against exact collinearity."""
    scale = np.sqrt(np.maximum(np.einsum("caa->ca", matrix), 1e-300))
    scaled = matrix / (scale[:, :, None] * scale[:, None, :]) + SMALL_RIDGE * np.eye(right.shape[1])
    target = right / scale
    free = np.linalg.solve(scaled, target[:, :, None])[:, :, 0]
    low, high = lower * scale, upper * scale
    for c in np.flatnonzero(np.any((free < low) | (free > high), axis=1)):
        _box_minimum(scaled[c], target[c], low[c], high[c], free[c])
    return free / scale


@njit(cache=True, nogil=True)
def _box_minimum(matrix, right, lower, upper, x):  # type: ignore[no-untyped-def]
    """Coordinate descent on a small box-constrained quadratic of unit diagonal, from x, in place."""
    k = x.size
    for a in range(k):
        x[a] = min(max(x[a], lower[a]), upper[a])
    for _ in range(SWEEPS):
        largest = 0.0
        for a in range(k):
            slope = right[a]
            for b in range(k):
                slope -= matrix[a, b] * x[b]
            new = min(max(x[a] + slope / matrix[a, a], lower[a]), upper[a])
            largest = max(largest, abs(new - x[a]))
            x[a] = new
        if largest <= CONVERGED * (1.0 + np.abs(x).max()):
            break


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
