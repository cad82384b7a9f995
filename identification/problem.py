"""The identification problem an estimator solves, and the linear algebra that estimators share."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from .base_parameters import BaseParameters
from .chain import Chain
from .covariance import variance_inflation
from .errors import InputError
from .estimate import Estimate
from .models import Observations, Preprocessing
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
    """

    chain: Chain
    base: BaseParameters
    observations: tuple[Observations, ...]
    motions: tuple[Motion, ...]
    preprocessing: Preprocessing
    nominal: Array

    @cached_property
    def stacked(self) -> tuple[Array, Array, NDArray[np.int64]]:
        """Used rows of all runs: regressor (K, b), torque (K,), joint of each row (K,).

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

    def weighted_least_squares(self, weights: Array) -> Array:
        """Values (b,) that minimise the squared residuals with joint j's rows times weights[j] (n,)."""
        rows, torque, joint = self.stacked
        scale = weights[joint]
        scaled = rows * scale[:, None]
        norms = np.linalg.norm(scaled, axis=0)
        q, r = np.linalg.qr(scaled / norms)
        return np.linalg.solve(r, q.T @ (torque * scale)) / norms

    def residual_std(self, values: Array) -> tuple[Array, Array]:
        """Residual standard deviation (n,) N·m and variance inflation (n,) of a joint at ``values``."""
        residuals = [run.residual(values) for run in self.observations]
        variance, inflation = variance_inflation(residuals, [run.used for run in self.observations])
        return np.sqrt(variance), inflation

    def linear_estimate(self, values: Array, weights: Array, estimator: str) -> Estimate:
        """The Estimate of a (weighted) linear fit, with its sandwich covariance.

        Covariance A^-1 (sum_j w_j^4 s_j^2 f_j W_j'W_j) A^-1 with A = sum_j w_j^2 W_j'W_j, residual
        deviation s_j and variance inflation f_j of joint j: exact for white noise, and widened by
        the effective sample size for coloured.
        """
        rows, _, joint = self.stacked
        condition = self.condition_number
        std, inflation = self.residual_std(values)
        counts = np.bincount(joint, minlength=self.chain.joints).astype(float)
        norms = np.linalg.norm(rows * weights[joint][:, None], axis=0)
        scaled = rows / norms
        bread = np.zeros((self.base.count, self.base.count))
        meat = np.zeros_like(bread)
        for j in range(self.chain.joints):
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
            effective_samples=float(np.sum(counts / inflation)),
            estimator=estimator,
        )
