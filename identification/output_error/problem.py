"""A limb's runs against its simulation: residuals, costs and derivatives by the unknowns.

Derivatives are carried along by the simulation (servo_tangent.py); where a play, a rounding or a rate acts,
or the loop chatters, they are by differences, all their simulations one batch. Either way the differences are
tiny: joints that stop make the position a function with kinks, and one that is crossed passes for information
on what is not determined.
"""

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from ..chain import Chain
from ..covariance import variance_inflation
from .servo_loop import Simulated, Window, simulate
from .servo_run import ServoRun, counted, windows
from .servo_tangent import is_smooth, tangents
from .unknowns import Unknowns

Array = NDArray[np.float64]

# Step of a difference, in the prior's deviations.
DIFFERENCE = 1e-6
# rad a deviation: derivatives beyond it are those of a loop that chatters, and grow without end.
CHATTER = 1e3
# Numbers that are simulated at once, which bounds memory.
AT_ONCE = 8_000_000
# rad (m): below it a residual is rounding.
SMALLEST = 1e-9


class Problem:
    """Simulations of a limb's windows, and what follows from them; unknowns in units of their prior."""

    def __init__(self, chain: Chain, unknown: Unknowns, runs: Sequence[ServoRun], threads: int | None):
        self._chain, self.unknown, self._threads = chain, unknown, threads
        self._groups: list[tuple[ServoRun, list[Window]]] = []
        candidates = unknown.count + 1
        for run in runs:
            together: list[Window] = []
            for window in windows(run):
                size = sum(each.stop - each.start for each in (*together, window))
                if together and 3 * size * chain.joints * candidates > AT_ONCE:
                    self._groups.append((run, together))
                    together = []
                together.append(window)
            self._groups.append((run, together))

    def _batch(self, run: ServoRun, own: Sequence[Window], tables: Array) -> list[list[Simulated]]:
        return simulate(self._chain, tables, own, run.rate, self._threads)

    def _errors(self, run: ServoRun, own: Sequence[Window], simulated: Sequence[Simulated]) -> list[Array]:
        """Simulated less measured position in each window after its settling, (M, n)."""
        return [
            (each.position - run.position[window.start : window.stop])[counted(window, run.rate)]
            for window, each in zip(own, simulated, strict=True)
        ]

    def residuals(self, values: Array) -> list[Array]:
        """Of every window, (M, n) rad."""
        return [
            error
            for run, own in self._groups
            for error in self._errors(run, own, self._batch(run, own, self.unknown.table(values[None]))[0])
        ]

    def simulatable(self, values: Array) -> Array:
        """Values (m,), moved towards the prior's mean until no window runs away.

        Inertia from a regression need not be positive along the whole motion.
        """
        centre = self.unknown.held(self.unknown.mean)
        for share in (1.0, 0.5, 0.25, 0.125):
            trial = centre + share * (values - centre)
            if all(np.isfinite(each).all() for each in self.residuals(trial)):
                return trial
        return centre

    def weights(self, values: Array, counts_all: bool = False) -> Array:
        """(n,) 1/rad, one over s_j sqrt(f_j); f of 1 where every sample counts."""
        std, inflation = spread(self.residuals(values))
        return np.asarray(1 / (np.maximum(std, SMALLEST) * np.sqrt(1.0 if counts_all else inflation)))

    def costs(self, values: Array, weights: Array) -> Array:
        """Half the weighted squares and the prior's, of candidates (C, m); infinite where one runs away."""
        scaled = (values - self.unknown.mean) / self.unknown.deviation
        total = 0.5 * np.sum(scaled**2, axis=1)
        for run, own in self._groups:
            for index, simulated in enumerate(self._batch(run, own, self.unknown.table(values))):
                for error in self._errors(run, own, simulated):
                    total[index] += 0.5 * float(np.sum((error * weights) ** 2))
        return np.where(np.isfinite(total), total, np.inf)

    def linearised(self, values: Array, weights: Array) -> tuple[Array, Array, float]:
        """Information (n, m, m), gradient (m,) of the runs and their half squares, in the prior's units."""
        m = self.unknown.count
        each = (
            window for run, own in self._groups for window in self._sensitivities(run, own, values, range(m))
        )
        return summed(each, weights, m)

    def derivatives(self, values: Array, of: Sequence[int]) -> tuple[list[Array], list[Array]]:
        """Derivatives (M, n, k) by some unknowns, rad a deviation of each, and errors (M, n), by window."""
        parts = [each for run, own in self._groups for each in self._sensitivities(run, own, values, of)]
        return [rows for rows, _ in parts], [base for _, base in parts]

    def _sensitivities(
        self, run: ServoRun, own: Sequence[Window], values: Array, of: Sequence[int]
    ) -> list[tuple[Array, Array]]:
        """Derivatives (M, n, k) by some unknowns, rad a deviation of each, and errors (M, n)."""
        unknown, places = self.unknown, np.asarray(of, dtype=np.int64)
        directions = unknown.basis[places] * unknown.deviation[places, None, None]
        table = unknown.table(values)
        if len(places) and is_smooth(table, directions):
            carried = self._tangents(run, own, table, directions)
            if all(np.abs(rows).max(initial=0.0) < CHATTER for rows, _ in carried):
                return carried
        # A step goes where there is room.
        steps = np.where(values + DIFFERENCE * unknown.deviation > unknown.upper, -DIFFERENCE, DIFFERENCE)
        moved = np.tile(values, (len(places) + 1, 1))
        moved[np.arange(1, len(places) + 1), places] += (steps * unknown.deviation)[places]
        errors = [self._errors(run, own, each) for each in self._batch(run, own, unknown.table(moved))]
        out = []
        for index, base in enumerate(errors[0]):
            rows = np.zeros((*base.shape, len(places)))
            for column, each in enumerate(errors[1:]):
                rows[..., column] = (each[index] - base) / steps[places[column]]
            # A difference of a candidate that ran away tells nothing.
            out.append((np.where(np.isfinite(rows), rows, 0.0), base))
        return out

    def _tangents(
        self, run: ServoRun, own: Sequence[Window], table: Array, directions: Array
    ) -> list[tuple[Array, Array]]:
        """The same of a table whose derivatives every step carries along."""
        found = tangents(self._chain, table, directions, own, run.rate, self._threads)
        errors = self._errors(run, own, [simulated for simulated, _ in found])
        return [
            (np.where(np.isfinite(rows), rows, 0.0)[counted(window, run.rate)], base)
            for window, (_, rows), base in zip(own, found, errors, strict=True)
        ]

    def profile(
        self, weights: Array, derivatives: Sequence[Array], starts: Array, tables: Array
    ) -> tuple[Array, Array]:
        """Cost (C,) of other tables (C, n, WIDTH), and the values (C, m) of the unknowns that lower it most.

        starts: (C, m), of the unknowns in each table, with which position moves by the derivatives. The cost
        is infinite where a table runs away.
        """
        unknown, m = self.unknown, self.unknown.count
        slopes = (starts - unknown.mean) / unknown.deviation
        costs = 0.5 * np.sum(slopes**2, axis=1)
        distinct, which = np.unique(tables.reshape(len(tables), -1), axis=0, return_inverse=True)
        distinct = distinct.reshape(-1, *tables.shape[1:])
        matrix, gradients, halves = np.eye(m), np.zeros((len(distinct), m)), np.zeros(len(distinct))
        scaled = iter([(rows * weights[:, None]).reshape(-1, m) for rows in derivatives])
        for run, own in self._groups:
            parts = [next(scaled) for _ in own]
            matrix += sum(rows.T @ rows for rows in parts)
            for first in range(0, len(distinct), m + 1):
                batch = self._batch(run, own, distinct[first : first + m + 1])
                for place, simulated in enumerate(batch, start=first):
                    for rows, error in zip(parts, self._errors(run, own, simulated), strict=True):
                        weighted = (error * weights).ravel()
                        halves[place] += 0.5 * float(weighted @ weighted)
                        if np.isfinite(halves[place]):
                            gradients[place] += rows.T @ weighted
        which = which.ravel()
        costs, slopes = costs + halves[which], slopes + gradients[which]
        steps = -np.linalg.solve(matrix, slopes.T).T
        costs += 0.5 * np.sum(slopes * steps, axis=1)
        return np.where(np.isfinite(costs), costs, np.inf), unknown.held(starts + steps * unknown.deviation)


def summed(windows: Iterable[tuple[Array, Array]], weights: Array, m: int) -> tuple[Array, Array, float]:
    """Information (n, m, m) by joint, gradient (m,) and half squares of all windows.

    windows: derivatives (M, n, m) by the unknowns and errors (M, n) of each. weights: (n,).
    """
    information, gradient, total = np.zeros((len(weights), m, m)), np.zeros(m), 0.0
    for rows, errors in windows:
        by_joint, weighted = np.moveaxis(rows * weights[:, None], 1, 0), errors * weights
        information += np.swapaxes(by_joint, 1, 2) @ by_joint
        gradient += np.einsum("jtm,tj->m", by_joint, weighted, optimize=True)
        total += 0.5 * float(np.sum(weighted**2))
    return information, gradient, total


def spread(residuals: Sequence[Array]) -> tuple[Array, Array]:
    """Deviation and inflation (n,) of residuals; each window's own course counts, its mean too."""
    residuals = [np.where(np.isfinite(each), each, 1.0) for each in residuals]
    variance, inflation = variance_inflation(
        residuals, [np.ones(each.shape, dtype=bool) for each in residuals]
    )
    return np.sqrt(variance), inflation
