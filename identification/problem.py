"""The identification problem an estimator solves, and the linear algebra that estimators share."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular

from .base_parameters import BaseParameters
from .chain import Chain
from .closed_loop import ClosedLoop
from .covariance import variance_inflation
from .errors import InputError
from .estimate import Estimate
from .observations import Observations, Preprocessing
from .prior import BasePrior
from .row_parts import column_norms, triangle
from .signals import Motion

Array = NDArray[np.float64]

# Beyond this the scaled regressor has lost a direction to double precision's square root.
SINGULAR_CONDITION = 1e7
# Share of the torque that the model leaves, taken for noise until a fit has shown it.
FAINT = 1e-2
# Bytes of the equations that are worked on at once; more are taken in parts.
MOST_AT_ONCE = 1 << 27


@dataclass(frozen=True)
class Problem:
    """What an estimator is given.

    chain: kinematics. base: the parameters to estimate. observations: the equations of every run fitted.
    motions: the raw runs behind them, in the same order. preprocessing: how one became the other.
    nominal: (14 n,) standard parameters of the model as given, a starting point and a prior.
    closed_loop: simulates the runs, where the logs tell reference and controller. prior: holds what the
    motion leaves open at the model; None where every parameter must be excited.
    """

    chain: Chain
    base: BaseParameters
    observations: tuple[Observations, ...]
    motions: tuple[Motion, ...]
    preprocessing: Preprocessing
    nominal: Array
    closed_loop: ClosedLoop | None = None
    prior: BasePrior | None = None

    @cached_property
    def stacked(self) -> tuple[Array, Array, NDArray[np.int64]]:
        """Used rows of all runs: regressor (K, b), torque (K,), equation of each row (K,): its joint.

        Raises InputError when there are fewer rows than parameters that no prior holds.
        """
        self._require_rows()
        used = [run.used for run in self.observations]
        rows = np.concatenate([run.regressor[u] for run, u in zip(self.observations, used, strict=True)])
        torque = np.concatenate([run.torque[u] for run, u in zip(self.observations, used, strict=True)])
        return rows, torque, np.concatenate([np.nonzero(u)[1] for u in used])

    @property
    def counts(self) -> NDArray[np.int64]:
        """Used rows of each equation, (e,)."""
        return np.sum([run.used.sum(axis=0) for run in self.observations], axis=0, dtype=np.int64)

    def parts(self) -> Iterator[tuple[Array, Array, NDArray[np.int64]]]:
        """The same rows as ``stacked``, in parts where all at once would fill the memory."""
        if sum(run.regressor.nbytes for run in self.observations) <= MOST_AT_ONCE:
            yield self.stacked
            return
        self._require_rows()
        for run in self.observations:
            size = max(1, MOST_AT_ONCE // run.regressor[:1].nbytes)
            for first in range(0, len(run.time), size):
                part = slice(first, first + size)
                used = run.used[part]
                yield run.regressor[part][used], run.torque[part][used], np.nonzero(used)[1]

    def _require_rows(self) -> None:
        needed, count = (self.base.count if self.prior is None else 1), int(self.counts.sum())
        if count < needed:
            raise InputError("logs", "motion", f"at least {needed} samples outside the dead zone", f"{count}")

    @cached_property
    def condition_number(self) -> float:
        """Of the stacked regressor, columns scaled to unit norm; infinite where a column is zero.

        Raises InputError that names the parameter when the motion leaves one unexcited that no prior holds.
        """
        norms = column_norms(rows for rows, _, _ in self.parts())
        if np.any(norms == 0):
            if self.prior is not None:
                return np.inf
            self._unexcited(int(np.argmin(norms)))
        upper = triangle(rows / norms for rows, _, _ in self.parts())
        _, singular, right = np.linalg.svd(upper)
        condition = float(singular[0] / singular[-1]) if singular[-1] > 0 else np.inf
        if condition > SINGULAR_CONDITION and self.prior is None:
            self._unexcited(int(np.argmax(np.abs(right[-1]))))
        return condition

    def _unexcited(self, column: int) -> None:
        joint = self.chain.link_names[int(self.base.columns[column]) // 14]
        raise InputError(
            "logs",
            "motion",
            "a motion that excites every base parameter",
            f"nothing that reveals {self.base.names[column]} ({joint}); without --strict, wls holds it at the"
            " model's value",
        )

    @property
    def equations(self) -> int:
        """Equations an instant, e: one a joint, or one in all by the energy and power models."""
        return self.observations[0].torque.shape[1]

    def whitened(self, covariances: Sequence[Array]) -> "Problem":
        """The same problem with each instant's equations multiplied by the inverse Cholesky factor of
        their covariance: then they are independent, of unit variance.

        covariances: a run, (M, e, e) or (e, e) for all its instants; unused rows take no part.
        """
        runs = []
        for run, covariance in zip(self.observations, covariances, strict=True):
            both = run.used[:, :, None] & run.used[:, None, :]
            factor = np.linalg.cholesky(np.where(both, covariance, np.eye(self.equations)))
            sides = np.where(run.used[:, :, None], np.dstack([run.regressor, run.torque[:, :, None]]), 0.0)
            white = np.asarray(np.linalg.solve(factor, sides), dtype=np.float64)
            runs.append(replace(run, regressor=white[:, :, :-1], torque=white[:, :, -1]))
        return replace(self, observations=tuple(runs))

    def weighted_least_squares(self, weights: Array) -> Array:
        """Values (b,) that minimise the squared residuals with equation j's rows times weights[j] (e,).

        Where there is a prior, its rows count against the noise that the residual itself shows.
        """
        if self.prior is None:
            return self._least_squares(weights, None)
        mean = self.prior.mean
        gaps = [(torque - rows @ mean) * weights[joint] for rows, torque, joint in self.parts()]
        # Held by next to nothing, the rows show their noise.
        rms = float(np.linalg.norm([np.linalg.norm(gap) for gap in gaps])) / np.sqrt(self.counts.sum())
        least = FAINT * rms
        values = self._least_squares(weights, least + np.finfo(float).tiny)
        return self._least_squares(weights, self.row_noise(values, weights))

    def weighted_parts(self, weights: Array, noise: float | None = None) -> Iterator[tuple[Array, Array]]:
        """All rows times their equation's weight (e,), (K, b) and (K,) in parts, and below them the prior's.

        noise: standard deviation of a weighted row, which the prior is counted against; None leaves it out.
        """
        below: list[tuple[Array, Array]] = []
        for rows, torque, joint in self.parts():
            yield from below
            scale = weights[joint]
            below = [(rows * scale[:, None], torque * scale)]
        rows, torque = below[0]
        if self.prior is not None and noise is not None:
            held = noise * np.sqrt(self.prior.strength) * self.prior.root
            rows, torque = np.vstack([rows, held]), np.concatenate([torque, held @ self.prior.mean])
        yield rows, torque

    def weighted_triangle(self, weights: Array, noise: float | None = None) -> tuple[Array, Array]:
        """R of the QR of all ``weighted_parts``, columns scaled to unit norm and the torque to the right.

        (b + 1, b + 1), and the columns' norms (b,). The last column holds Q' tau.
        """
        norms = column_norms(rows for rows, _ in self.weighted_parts(weights, noise))
        upper = triangle(
            np.column_stack([rows / norms, torque]) for rows, torque in self.weighted_parts(weights, noise)
        )
        return upper, norms

    def _least_squares(self, weights: Array, noise: float | None) -> Array:
        upper, norms = self.weighted_triangle(weights, noise)
        return solve_triangular(upper[:-1, :-1], upper[:-1, -1]) / norms

    def row_noise(self, values: Array, weights: Array) -> float:
        """Standard deviation of a weighted row at ``values``, widened by its inflation; never zero."""
        std, inflation = self.residual_std(values)
        counts = self.counts
        variance = np.sum(counts * weights**2 * std**2 * inflation) / counts.sum()
        return float(np.sqrt(variance) + np.finfo(float).tiny)

    def residual_std(self, values: Array) -> tuple[Array, Array]:
        """Residual standard deviation (e,) and variance inflation (e,) of each equation at ``values``."""
        residuals = [run.residual(values) for run in self.observations]
        variance, inflation = variance_inflation(residuals, [run.used for run in self.observations])
        return np.sqrt(variance), inflation

    def independent_samples(self, values: Array) -> Array:
        """Effective sample size of each equation's residual at ``values``, (e,): used rows over inflation."""
        _, inflation = self.residual_std(values)
        return self.counts / inflation

    def residual_weights(self, values: Array) -> Array:
        """1 / residual deviation of each equation at ``values``, (e,), widened by its inflation."""
        std, inflation = self.residual_std(values)
        spread = std * np.sqrt(inflation)
        # Noise-free data would divide by zero; deviations below rounding say nothing about weights.
        return 1 / np.maximum(spread, 1e-9 * np.max(spread) + np.finfo(float).tiny)

    def linear_estimate(self, values: Array, weights: Array, estimator: str) -> Estimate:
        """The Estimate of a (weighted) linear fit, with its sandwich covariance.

        Covariance A^-1 (sum_j w_j^4 s_j^2 f_j W_j'W_j) A^-1 with A = sum_j w_j^2 W_j'W_j, residual
        deviation s_j and variance inflation f_j of equation j: exact for white noise, and widened by
        the effective sample size for coloured. A prior adds to both sums: what no row tells keeps its width,
        widened by how far from the model that lies which the rows tell.
        """
        condition = self.condition_number
        std, inflation = self.residual_std(values)
        norms = column_norms(rows for rows, _ in self.weighted_parts(weights))
        if self.prior is not None:
            norms = np.hypot(norms, self.row_noise(values, weights) * np.linalg.norm(self.prior.root, axis=0))
        bread = np.zeros((self.base.count, self.base.count))
        meat = np.zeros_like(bread)
        for rows, _, joint in self.parts():
            scaled = rows / norms
            for j in range(self.equations):
                block = scaled[joint == j]
                information = block.T @ block
                bread += weights[j] ** 2 * information
                meat += weights[j] ** 4 * std[j] ** 2 * inflation[j] * information
        # Each parameter costs a degree of freedom.
        count = int(self.counts.sum())
        freedom = count / max(1.0, count - self.base.count)
        meat *= freedom
        if self.prior is not None:
            variance = self.row_noise(values, weights) ** 2
            precision = self.prior.precision / np.outer(norms, norms)
            held = bread + variance * self.prior.strength * precision
            known = float(np.trace(np.linalg.solve(held, bread)))
            change = norms * (values - self.prior.mean)
            widening = max(1.0, float(change @ precision @ change) / max(known, 1.0))
            bread, meat = held, meat + widening * (variance * self.prior.strength) ** 2 * precision
        inverse = np.linalg.inv(bread)
        covariance = inverse @ meat @ inverse / np.outer(norms, norms)
        return Estimate(
            base=self.base,
            values=values,
            covariance=0.5 * (covariance + covariance.T),
            noise_std=std,
            condition_number=condition,
            effective_samples=float(np.sum(self.independent_samples(values))),
            estimator=estimator,
        )
