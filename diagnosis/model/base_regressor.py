"""Base regressor of these runs and its products, computed once and shared by every hypothesis.

Rigid body, rotors, friction and offsets of every joint, and a common timing error; to the right of them each
hypothesis adds its effects' own few columns.
"""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from identification.held_estimate import LEAST_TORQUE, SLOWEST
from identification.prior import TIMING, parameter_widths
from testbench.effects.logged import MOST_BYTES

from ..data.run import Prepared

Array = NDArray[np.float64]


class BaseRegressor:
    """Base regressor and gap of prepared runs, with their used rows gathered by fold and joint.

    loading: (n,) the unknowns (u,) that load each joint: of the links that it moves, and the timing error.
    gap: a run, (M, n) N·m, torque less the model's. used: a fold, a joint, the run's samples that count. y:
    their rows of the gap, (m,). xx, xy: the products, (u, u) of a fold and what loads a joint, and (F, n, p).
    precision: (p,) of the prior. torque_rms: (n,) N·m of the joints' torque. is_small: whether gathered rows
    are kept; those of longer runs are gathered whenever they are read.
    """

    def __init__(self, prepared: Prepared):
        self.prepared, self.folds, self.joints = prepared, prepared.folds, prepared.joints
        torque = np.concatenate([run.torque for run in prepared.runs])
        reported = np.sqrt(np.mean(torque**2, axis=0))
        self.torque_rms = np.maximum(reported, LEAST_TORQUE * reported.max())
        speed, acceleration = (
            np.sqrt(np.mean(np.concatenate(part) ** 2, axis=0)).clip(SLOWEST)
            for part in ([run.logged.dq for run in prepared.runs], [run.logged.ddq for run in prepared.runs])
        )
        widths = parameter_widths(prepared.nominal, self.torque_rms, speed, acceleration)
        self.precision = np.append(widths, TIMING) ** -2.0
        chain, unknowns = prepared.robot.chain, np.arange(self.parameters)
        self.loading = tuple(
            np.append(unknowns[chain.loading(joint)], unknowns[-1]) for joint in range(self.joints)
        )
        self._late = [
            np.hstack([run.filtered(run.logged.predicted_rate(j)[:, None], [j]) for j in range(self.joints)])
            for run in prepared.runs
        ]
        self.is_small = sum(rows.nbytes for run in prepared.runs for rows in run.rows) <= MOST_BYTES
        self._columns: dict[tuple[int, int], Array] = {}
        self._x: dict[tuple[int, int], Array] = {}
        self.gap = tuple(run.torque - run.by_model(prepared.nominal) for run in prepared.runs)
        self.used = [
            [np.flatnonzero(prepared.runs[run].used[part, j]) + part.start for j in range(self.joints)]
            for run, part in self.folds
        ]
        self.y = self.rows(self.gap)
        self.xx = [[self._square(f, j) for j in range(self.joints)] for f in range(len(self.folds))]
        self.xy = self.products(dict(enumerate(self.y)))

    @property
    def parameters(self) -> int:
        """Number of unknowns without effects, p."""
        return len(self.precision)

    def products(self, y: Mapping[int, Sequence[Array]]) -> Array:
        """X'y (F, n, p) of used rows (m,) of some folds: by fold, in their order, and joint."""
        found = np.zeros((len(y), self.joints, self.parameters))
        for place, (fold, left) in enumerate(y.items()):
            for joint, own in enumerate(self.loading):
                found[place, joint, own] = self.x(fold, joint).T @ left[joint]
        return found

    def columns(self, run: int, joint: int, part: slice = slice(None)) -> Array:
        """Base regressor of a joint along a part of a run, (M, u) of the u unknowns that load it."""
        if not self.is_small:
            return self._stacked(run, joint, part)
        if (run, joint) not in self._columns:
            self._columns[run, joint] = self._stacked(run, joint, slice(None))
        return self._columns[run, joint][part]

    def x(self, fold: int, joint: int) -> Array:
        """Used rows of the base regressor of one fold and joint, (m, u)."""
        run, used = self.folds[fold][0], self.used[fold][joint]
        if not self.is_small:
            return self._stacked(run, joint, used)
        if (fold, joint) not in self._x:
            self._x[fold, joint] = self.columns(run, joint)[used]
        return self._x[fold, joint]

    def _square(self, fold: int, joint: int) -> Array:
        """X'X of one fold and joint, (u, u)."""
        x = self.x(fold, joint)
        return x.T @ x

    def _stacked(self, run: int, joint: int, part: slice | NDArray[np.int64]) -> Array:
        """Some samples of the standard regressor, with the timing error to the right of it."""
        return np.column_stack([self.prepared.runs[run].rows[joint][part], -self._late[run][part, joint]])

    def rows(self, runs: Sequence[Array]) -> list[list[Array]]:
        """Used rows of arrays (M, n, ...), one a run: a fold, a joint."""
        return [[self.rows_of(runs, f, j) for j in range(self.joints)] for f in range(len(self.folds))]

    def rows_of(self, runs: Sequence[Array], fold: int, joint: int, place: int | None = None) -> Array:
        """Used rows of one fold and joint. place: of the joint in the arrays, where that is not its index."""
        at = joint if place is None else place
        return runs[self.folds[fold][0]][:, at].take(self.used[fold][joint], axis=0)
