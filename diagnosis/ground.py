"""What every hypothesis stands on: the base regressor of these runs, and its products, taken once.

Rigid body, rotors, friction and offsets of every joint, and a common timing error; to the right of them each
hypothesis adds its effects' own few columns.
"""

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from .preparation import Prepared
from .prior import TIMING, parameter_widths

Array = NDArray[np.float64]

# rad/s (m/s), and rad/s² (m/s²): what a joint that is at rest counts as moving by.
SLOWEST = 0.01
# Of the strongest joint's torque: a joint that reports none is judged by shares of its torque all the same.
LEAST_TORQUE = 1e-9


class Ground:
    """Base regressor and gap of prepared runs, with their used rows gathered by fold and joint.

    columns: a run, (M, n, p). gap: a run, (M, n) N·m, torque less the model's. used: a fold, a joint, the
    run's samples that count. x, y: their rows, (m, p) and (m,). xx, xy: the products, (F, n, p, p) and
    (F, n, p). precision: (p,) of the prior. torque_rms: (n,) N·m of the joints' torque.
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
        self.columns = tuple(
            np.concatenate(
                [run.rows, -run.filtered(run.logged.predicted_rate, range(self.joints))[:, :, None]], axis=2
            )
            for run in prepared.runs
        )
        self.gap = tuple(run.torque - run.rows @ prepared.nominal for run in prepared.runs)
        self.used = [
            [np.flatnonzero(prepared.runs[run].used[part, j]) + part.start for j in range(self.joints)]
            for run, part in self.folds
        ]
        self.x, self.y = self.rows(self.columns), self.rows(self.gap)
        self.xx = np.array([[x.T @ x for x in fold] for fold in self.x])
        self.xy = np.array(
            [[x.T @ y for x, y in zip(*both, strict=True)] for both in zip(self.x, self.y, strict=True)]
        )

    @property
    def parameters(self) -> int:
        """Number of unknowns without effects, p."""
        return len(self.precision)

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
