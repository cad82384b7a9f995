"""The identification problem an estimator solves, and the linear algebra that estimators share."""

from collections.abc import Sequence
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
from .signals import Motion

Array = NDArray[np.float64]

# Beyond this the scaled regressor has lost a direction to double precision's square root.
SINGULAR_CONDITION = 1e7
# Share of the torque that the model leaves, taken for noise until a fit has shown it.
FAINT = 1e-2


@dataclass(frozen=True)
class Problem:
    """What an estimator is given.

    chain: kinematics. base: the parameters sought. observations: the equations of every run fitted.
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
        used = [run.used for run in self.observations]
        rows = np.concatenate([run.regressor[u] for run, u in zip(self.observations, used, strict=True)])
        torque = np.concatenate([run.torque[u] for run, u in zip(self.observations, used, strict=True)])
        joint = np.concatenate([np.nonzero(u)[1] for u in used])
        needed = self.base.count if self.prior is None else 1
        if len(rows) < needed:
            raise InputError(
                "logs", "motion", f"at least {needed} samples outside the dead zone", f"{len(rows)}"
            )
        return rows, torque, joint

    @cached_property
    def condition_number(self) -> float:
        """Of the stacked regressor, columns scaled to unit norm; infinite where a column is zero.

        Raises InputError that names the parameter when the motion leaves one unexcited that no prior holds.
        """
        rows, _, _ = self.stacked
        norms = np.linalg.norm(rows, axis=0)
        if np.any(norms == 0):
            if self.prior is not None:
                return np.inf
            self._unexcited(int(np.argmin(norms)))
        upper = np.linalg.qr(rows / norms, mode="r")
        _, singular, right = np.linalg.svd(upper)
        condition = float(singular[0] / singular[-1]) if singular[-1] > 0 else np.inf
        if condition > SINGULAR_CONDITION and self.prior is None:
            self._unexcited(int(np.argmax(np.abs(right[-1]))))
        return condition

    def _unexcited(self, column: int) -> None:
        joint = self.chain.joint_names[int(self.base.columns[column]) // 14]
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
            return _least_squares(*self.weighted_rows(weights))
        rows, torque, joint = self.stacked
        scale = weights[joint]
        # Held by next to nothing, the rows show their noise.
        least = FAINT * float(np.linalg.norm((torque - rows @ self.prior.mean) * scale)) / np.sqrt(len(rows))
        values = _least_squares(*self.weighted_rows(weights, least + np.finfo(float).tiny))
        return _least_squares(*self.weighted_rows(weights, self.row_noise(values, weights)))

    def weighted_rows(self, weights: Array, noise: float = 1.0) -> tuple[Array, Array]:
        """All rows times their equation's weight (e,), (K, b) and (K,), and below them those of the prior.

        noise: standard deviation of a weighted row, which the prior is counted against.
        """
        rows, torque, joint = self.stacked
        scale = weights[joint]
        rows, torque = rows * scale[:, None], torque * scale
        if self.prior is None:
            return rows, torque
        held = noise * np.sqrt(self.prior.strength) * self.prior.root
        return np.vstack([rows, held]), np.concatenate([torque, held @ self.prior.mean])

    def row_noise(self, values: Array, weights: Array) -> float:
        """Standard deviation of a weighted row at ``values``, widened by its inflation; never zero."""
        std, inflation = self.residual_std(values)
        counts = np.bincount(self.stacked[2], minlength=self.equations)
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
        return np.bincount(self.stacked[2], minlength=self.equations) / inflation

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
        rows, _, joint = self.stacked
        condition = self.condition_number
        std, inflation = self.residual_std(values)
        norms = np.linalg.norm(rows * weights[joint][:, None], axis=0)
        if self.prior is not None:
            norms = np.hypot(norms, self.row_noise(values, weights) * np.linalg.norm(self.prior.root, axis=0))
        scaled = rows / norms
        bread = np.zeros((self.base.count, self.base.count))
        meat = np.zeros_like(bread)
        for j in range(self.equations):
            block = scaled[joint == j]
            information = block.T @ block
            bread += weights[j] ** 2 * information
            meat += weights[j] ** 4 * std[j] ** 2 * inflation[j] * information
        # Each parameter costs a degree of freedom.
        freedom = len(rows) / max(1.0, len(rows) - self.base.count)
        meat *= freedom
        if self.prior is not None:
            variance = self.row_noise(values, weights) ** 2
            precision = self.prior.precision / np.outer(norms, norms)
            held = bread + variance * self.prior.strength * precision
            told = float(np.trace(np.linalg.solve(held, bread)))
            change = norms * (values - self.prior.mean)
            widening = max(1.0, float(change @ precision @ change) / max(told, 1.0))
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


def _least_squares(rows: Array, torque: Array) -> Array:
    norms = np.linalg.norm(rows, axis=0)
    # The factor of [W tau] holds Q'tau in its last column; Q itself is never formed.
    upper = np.asarray(np.linalg.qr(np.column_stack([rows / norms, torque]), mode="r"))
    return solve_triangular(upper[:-1, :-1], upper[:-1, -1]) / norms
