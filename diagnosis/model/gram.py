"""Candidates side by side, their columns multiplied once with each other and with the base regressor."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from testbench.effects.logged import MOST_BYTES

from .base_regressor import BaseRegressor
from .candidate import Candidate

Array = NDArray[np.float64]


class Bank:
    """Candidates with the products of their columns with each other and with the base regressor.

    K columns of all candidates side by side. owner: (K,) the candidate of each. joints: those that any
    reaches. Sums are kept apart by fold and joint, since weights change from one hypothesis to the next.
    """

    def __init__(self, base: BaseRegressor, proposals: Sequence[Candidate]):
        self.candidates = tuple(proposals)
        counts = np.array([c.count for c in proposals], dtype=np.int64)
        self.start = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
        self.owner = np.repeat(np.arange(len(counts)), counts)
        folds, n = range(len(base.folds)), base.joints
        self._base = base
        self._reach = [[c for c, each in enumerate(proposals) if j in each.member.rows] for j in range(n)]
        self.reached = [self._columns_of(own) for own in self._reach]
        self.joints = [j for j in range(n) if len(self.reached[j])]
        used = np.array([[len(rows) for rows in fold] for fold in base.used]).sum(axis=0)
        self._is_small = 8 * used @ [len(own) for own in self.reached] <= MOST_BYTES
        self._z: dict[tuple[int, int], Array] = {}
        self.zx: list[list[Array]] = [[] for _ in folds]
        # Candidates of the same number of coefficients are solved together.
        self.groups = [np.flatnonzero(counts == k) for k in np.unique(counts)]
        self.squares = [
            np.zeros((len(own), len(base.folds), n, *(2 * [counts[own[0]]]))) for own in self.groups
        ]
        place = {int(c): (g, i) for g, own in enumerate(self.groups) for i, c in enumerate(own)}
        for f in folds:
            for j, own in enumerate(self._reach):
                whole = self.z(f, j)
                self.zx[f].append(whole.T @ base.x(f, j))
                at = np.searchsorted(self.reached[j], [self.start[c] for c in own])
                for c, first in zip(own, at, strict=True):
                    g, i = place[c]
                    z = whole[:, first : first + counts[c]]
                    self.squares[g][i, f, j] = z.T @ z

    def z(self, fold: int, joint: int) -> Array:
        """Columns that reach a joint, of the used rows of a fold, (m, K_j)."""
        if (fold, joint) in self._z:
            return self._z[fold, joint]
        found = np.empty((len(self._base.used[fold][joint]), len(self.reached[joint])))
        column = 0
        for each in (self.candidates[c] for c in self._reach[joint]):
            # Filled one by one, as all of them twice would be most of a long log's memory.
            rows = self._base.rows_of(each.filtered, fold, joint, each.member.rows.index(joint))
            found[:, column : column + each.count] = rows
            column += each.count
        if self._is_small:
            self._z[fold, joint] = found
        return found

    def _columns_of(self, candidates: Sequence[int]) -> NDArray[np.int64]:
        """The columns of some candidates."""
        wanted = np.zeros(len(self.candidates), dtype=np.bool_)
        wanted[candidates] = True
        return np.flatnonzero(wanted[self.owner])
