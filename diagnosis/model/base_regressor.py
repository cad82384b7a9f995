"""Base regressor of these runs and its products, computed once and shared by every hypothesis.

Rigid body, rotors, friction and offsets of every joint, and a common timing error; to the right of them each
hypothesis adds its effects' own few columns.
"""

from collections.abc import Mapping, Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from identification.parameters import PER_JOINT
from identification.prior import TIMING, parameter_widths

from ..data.preparation import Prepared

Array = NDArray[np.float64]

# rad/s (m/s), and rad/s² (m/s²): what a joint that is at rest counts as moving by.
SLOWEST = 0.01
# Of the strongest joint's torque: a joint that reports none is judged by shares of its torque all the same.
LEAST_TORQUE = 1e-9


class Ground:
    """Base regressor and gap of prepared runs, with their used rows gathered by fold and joint.

    loading: (n,) the unknowns that load each joint: links before it never do. columns: a run, a joint, (M, u)
    of its u. gap: a run, (M, n) N·m, torque less the model's. used: a fold, a joint, the run's samples that
    count. x, y: their rows, (m, u) and (m,). xx, xy: the products, (F, n, p, p) and (F, n, p). precision:
    (p,) of the prior. torque_rms: (n,) N·m of the joints' torque.
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
        self.loading = tuple(slice(PER_JOINT * joint, None) for joint in range(self.joints))
        late = [run.filtered(run.logged.predicted_rate, range(self.joints)) for run in prepared.runs]
        self.columns = tuple(
            tuple(
                np.column_stack([run.rows[:, joint, loading], -own[:, joint]])
                for joint, loading in enumerate(self.loading)
            )
            for run, own in zip(prepared.runs, late, strict=True)
        )
        self.gap = tuple(run.torque - run.rows @ prepared.nominal for run in prepared.runs)
        self.used = [
            [np.flatnonzero(prepared.runs[run].used[part, j]) + part.start for j in range(self.joints)]
            for run, part in self.folds
        ]
        self.x = [
            [of_run[rows] for of_run, rows in zip(self.columns[run], used, strict=True)]
            for (run, _), used in zip(self.folds, self.used, strict=True)
        ]
        self.y = self.rows(self.gap)
        self.xx = np.zeros((len(self.folds), self.joints, self.parameters, self.parameters))
        for fold, of_fold in enumerate(self.x):
            for joint, (x, own) in enumerate(zip(of_fold, self.loading, strict=True)):
                self.xx[fold, joint, own, own] = x.T @ x
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
                found[place, joint, own] = self.x[fold][joint].T @ left[joint]
        return found

    def rows(self, runs: Sequence[Array]) -> list[list[Array]]:
        """Used rows of arrays (M, n, ...), one a run: a fold, a joint."""
        return [[self.rows_of(runs, f, j) for j in range(self.joints)] for f in range(len(self.folds))]

    def rows_of(self, runs: Sequence[Array], fold: int, joint: int, place: int | None = None) -> Array:
        """Used rows of one fold and joint. place: of the joint in the arrays, where that is not its index."""
        at = joint if place is None else place
        return runs[self.folds[fold][0]][self.used[fold][joint], at]


@lru_cache(maxsize=2)
def ground(prepared: Prepared) -> Ground:
    """The ground of prepared runs; that of the last two linearisations is remembered."""
    return Ground(prepared)
