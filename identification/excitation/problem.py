"""The design problem as functions of one vector: criterion, constraints and their exact gradients."""

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..chain import Chain
from ..regressor import regressor
from ..regressor_adjoint import regressor_adjoint
from .constraints import COULOMB_VELOCITY, MotionGradient, SmoothConstraints
from .criteria import Criterion
from .trajectory import TrajectoryBasis

Array = NDArray[np.float64]

SAMPLES_PER_PERIOD = 40


def sampling_times(basis: TrajectoryBasis[Any]) -> Array:
    """(T,) instants of one motion, 40 in a period of its fastest content; s."""
    count = int(np.ceil(SAMPLES_PER_PERIOD * basis.highest_frequency * basis.duration))
    return np.arange(count) * basis.duration / count


def weighted_regressor(
    chain: Chain, columns: NDArray[np.int64], torque_scale: Array, motion: tuple[Array, Array, Array]
) -> Array:
    """Base regressor (T n, b) of a motion, each row divided by its joint's torque scale (n,)."""
    matrix = regressor(chain, *motion, columns, COULOMB_VELOCITY)
    matrix /= torque_scale[:, None]
    return matrix.reshape(-1, len(columns))


@dataclass
class DesignProblem:
    """A criterion and constraints over a motion's free coefficients, scaled to order one.

    The variables z (size n,) are the coefficients (size, n) of ``basis``: the centre as offset from
    the middle of the range in halves of it, the others in the joint's largest speed.
    columns: (b,) base columns of the regressor. torque_scale: (n,) N·m (N). evaluations: of the
    criterion so far. Not for use by several threads at once.
    """

    chain: Chain
    basis: TrajectoryBasis[Any]
    columns: NDArray[np.int64]
    torque_scale: Array
    criterion: Criterion
    constraints: SmoothConstraints
    evaluations: int = 0
    _last: "_Point | None" = field(default=None, repr=False)

    def __post_init__(self) -> None:
        limits = self.constraints.limits
        half = (limits.upper - limits.lower) / 2
        middle_frequency = np.pi * (self.basis.highest_frequency + 1.0 / self.basis.duration)
        speed = np.minimum(limits.velocity, half * middle_frequency)
        self._scale = np.vstack([half, np.tile(speed, (self.basis.size - 1, 1))])
        self._offset = np.zeros(self._scale.shape)
        self._offset[0] = (limits.upper + limits.lower) / 2
        self._matrices = self.basis.matrices(sampling_times(self.basis))

    def variables(self, coefficients: Array) -> Array:
        """z of free coefficients (size, n)."""
        return ((coefficients - self._offset) / self._scale).ravel()

    def coefficients(self, z: Array) -> Array:
        """Free coefficients (size, n) of z."""
        return self._offset + self._scale * z.reshape(self._scale.shape)

    def value(self, z: Array) -> float:
        """The criterion."""
        return self._at(z).criterion[0]

    def gradient(self, z: Array) -> Array:
        """The criterion's derivative, shape of z."""
        point = self._at(z)
        seeds = point.criterion[1].reshape(*point.motion[0].shape, -1) / self.torque_scale[:, None]
        return self._of_variables(
            regressor_adjoint(self.chain, *point.motion, seeds, self.columns, COULOMB_VELOCITY)
        )

    def constraint_values(self, z: Array) -> Array:
        """(K,) values of ``SmoothConstraints``."""
        return self.constraints.values(*self._at(z).motion)

    def constraint_gradients(self, z: Array) -> Array:
        """(K, size n) derivatives of the constraint values."""
        motion = self._at(z).motion
        return np.array([self._of_variables(bars) for bars in self.constraints.gradients(*motion)])

    def _at(self, z: Array) -> "_Point":
        if self._last is None or not np.array_equal(self._last.z, z):
            self._last = _Point(self, z.copy())
        return self._last

    def _of_variables(self, bars: MotionGradient) -> Array:
        """The chain rule from q, dq and ddq to z."""
        total = sum(matrix.T @ bar for matrix, bar in zip(self._matrices, bars, strict=True))
        return (self._scale * total).ravel()


@dataclass
class _Point:
    """What is computed once at one z, when first asked for."""

    problem: DesignProblem
    z: Array

    @cached_property
    def motion(self) -> tuple[Array, Array, Array]:
        coefficients = self.problem.coefficients(self.z)
        q, dq, ddq = (matrix @ coefficients for matrix in self.problem._matrices)
        return q, dq, ddq

    @cached_property
    def criterion(self) -> tuple[float, Array]:
        problem = self.problem
        problem.evaluations += 1
        weighted = weighted_regressor(problem.chain, problem.columns, problem.torque_scale, self.motion)
        return problem.criterion(weighted, len(self.motion[0]))
