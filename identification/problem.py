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
from .signals import Motion

Array = NDArray[np.float64]

# Beyond this the scaled regressor has lost a direction to double precision's square root.
SINGULAR_CONDITION = 1e7


@dataclass(frozen=True)
class Problem:
    """What an estimator is given.

    chain: kinematics. base: the parameters sought. observations: the equations of every run fitted.
    motions: the raw runs behind them, in the same order. preprocessing: how one became the other.
    nominal: (14 n,) standard parameters of the model as given, a starting point and a prior.
    closed_loop: simulates the runs, where the logs tell reference and controller.
    """

    chain: Chain
    base: BaseParameters
    observations: tuple[Observations, ...]
    motions: tuple[Motion, ...]
    preprocessing: Preprocessing
    nominal: Array
    closed_loop: ClosedLoop | None = None

    @cached_property
    def stacked(self) -> tuple[Array, Array, NDArray[np.int64]]:
        """Used rows of all runs: regressor (K, b), torque (K,), equation of each row (K,): its joint.

        Raises InputError when there are fewer rows than parameters.
        """
        used = [run.used for run in self.observations]
        rows = np.concatenate([run.regressor[u] for run, u in zip(self.observations, used, strict=True)])
        torque = np.concatenate([run.torque[u] for run, u in zip(self.observations, used, strict=True)])
        joint = np.concatenate([np.nonzero(u)[1] for u in used])
        if len(rows) < self.base.count:
            raise InputError(
                "logs", "motion", f"at least {self.base.count} samples outside the dead zone", f"{len(rows)}"
            )
        return rows, torque, joint

    @cached_property
    def condition_number(self) -> float:
        """Of the stacked regressor, columns scaled to unit norm.

        Raises InputError that names the parameter when the motion leaves one unexcited.
        """
        rows, _, _ = self.stacked
        norms = np.linalg.norm(rows, axis=0)
        if np.any(norms == 0):
            self._unexcited(int(np.argmin(norms)))
        upper = np.linalg.qr(rows / norms, mode="r")
        _, singular, right = np.linalg.svd(upper)
        condition = float(singular[0] / singular[-1]) if singular[-1] > 0 else np.inf
        if condition > SINGULAR_CONDITION:
            self._unexcited(int(np.argmax(np.abs(right[-1]))))
        return condition

    def _unexcited(self, column: int) -> None:
        joint = self.chain.joint_names[int(self.base.columns[column]) // 14]
        raise InputError(
            "logs",
            "motion",
            "a motion that excites every base parameter",
            f"nothing that reveals {self.base.names[column]} ({joint})",
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
        """Values (b,) that minimise the squared residuals with equation j's rows times weights[j] (e,)."""
        rows, torque, joint = self.stacked
        scale = weights[joint]
        scaled = rows * scale[:, None]
        norms = np.linalg.norm(scaled, axis=0)
        # The factor of [W tau] holds Q'tau in its last column; Q itself is never formed.
        upper = np.asarray(np.linalg.qr(np.column_stack([scaled / norms, torque * scale]), mode="r"))
        return solve_triangular(upper[:-1, :-1], upper[:-1, -1]) / norms

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
        the effective sample size for coloured.
        """
        rows, _, joint = self.stacked
        condition = self.condition_number
        std, inflation = self.residual_std(values)
        norms = np.linalg.norm(rows * weights[joint][:, None], axis=0)
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
        inverse = np.linalg.inv(bread)
        covariance = freedom * inverse @ meat @ inverse / np.outer(norms, norms)
        return Estimate(
            base=self.base,
            values=values,
            covariance=0.5 * (covariance + covariance.T),
            noise_std=std,
            condition_number=condition,
            effective_samples=float(np.sum(self.independent_samples(values))),
            estimator=estimator,
        )
