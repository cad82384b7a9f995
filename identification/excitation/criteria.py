"""How informative a motion is: criteria on the weighted base regressor W, smaller is better.

W (M, b) stacks the base regressor's rows, each divided by its joint's torque scale. With C = W'W / N
the information a sample (N samples of n rows), each criterion gives its value and its exact
gradient with respect to W:

    hadamard    -sum_j log C_jj, which bounds -log det C from below (Hadamard's inequality); it
                costs only the column norms, and does not see collinear columns
    condition   log of the condition number of W with its columns scaled to unit norm
    logdet      -log det C, the D-optimal criterion

Jin & Gans (2015), doi 10.1016/j.rcim.2014.06.004; Swevers et al. (1997).
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..kinematics import kernel

Array = NDArray[np.float64]

Criterion = Callable[[Array, int], tuple[float, Array]]


@dataclass(frozen=True)
class CriterionValues:
    """All three criteria of one motion.

    hadamard: -sum log C_jj. logdet: -log det C. condition_number: of W with unit columns.
    """

    hadamard: float
    logdet: float
    condition_number: float

    @property
    def slack(self) -> float:
        """sum log C_jj - log det C >= 0: how much Hadamard's inequality misses through collinearity."""
        return self.logdet - self.hadamard


def hadamard(weighted: Array, samples: int) -> tuple[float, Array]:
    """-sum_j log(|w_j|² / N) and its gradient (M, b)."""
    norms = _squared_norms(weighted)
    _require_excited(norms)
    return -float(np.sum(np.log(norms / samples))), weighted * (-2.0 / norms)


def condition(weighted: Array, samples: int) -> tuple[float, Array]:
    """log cond of W with unit columns, and its gradient (M, b). ``samples`` has no effect on it.

    With C v = l v of the scaled Gram matrix C, dl/dw_j = 2 v_j / |w_j| (W~ v - l v_j w~_j).
    """
    values, vectors, scale = _scaled_eigenvalues(weighted)
    factors = np.zeros((weighted.shape[1], weighted.shape[1]))
    for index, sign in ((-1, 1.0), (0, -1.0)):
        v = vectors[:, index]
        factors += sign * (np.outer(v, v) / values[index] - np.diag(v * v))
    return 0.5 * float(np.log(values[-1] / values[0])), _times(weighted, factors / np.outer(scale, scale))


def logdet(weighted: Array, samples: int) -> tuple[float, Array]:
    """-log det(W'W / N) and its gradient -2 W (W'W)^-1, (M, b)."""
    values, vectors, scale = _scaled_eigenvalues(weighted)
    inverse = (vectors / values) @ vectors.T / np.outer(scale, scale)
    value = -float(np.sum(np.log(values)) + np.sum(np.log(scale**2 / samples)))
    return value, _times(weighted, -2.0 * inverse)


CRITERIA: dict[str, Criterion] = {"hadamard": hadamard, "condition": condition, "logdet": logdet}


def criterion_named(name: str) -> Criterion:
    """The criterion of that name. Raises InputError."""
    if name not in CRITERIA:
        raise InputError("excitation", "criterion", "a known criterion", repr(name), CRITERIA)
    return CRITERIA[name]


def criterion_values(weighted: Array, samples: int) -> CriterionValues:
    """All three criteria of a weighted base regressor (M, b). Raises InputError where none exists."""
    return CriterionValues(
        hadamard=hadamard(weighted, samples)[0],
        logdet=logdet(weighted, samples)[0],
        condition_number=float(np.exp(condition(weighted, samples)[0])),
    )


def _scaled_eigenvalues(weighted: Array) -> tuple[Array, Array, Array]:
    """Eigenvalues (ascending) and vectors of the Gram matrix of W with unit columns, and the norms."""
    gram = _gram(weighted)
    _require_excited(np.diag(gram))
    scale = np.sqrt(np.diag(gram))
    values, vectors = np.linalg.eigh(gram / np.outer(scale, scale))
    # A collinear pair gives an eigenvalue at rounding level, which may be negative.
    return np.maximum(values, np.finfo(float).eps), vectors, scale


def _require_excited(norms: Array) -> None:
    if not np.all(norms > 0):
        count = int(np.sum(~(norms > 0)))
        raise InputError("excitation", "motion", "a motion that moves every base parameter", f"{count} unexcited")


# Written out rather than left to BLAS, whose summation order may change with the number of threads.
@kernel
def _squared_norms(matrix):  # type: ignore[no-untyped-def]
    """Sum of squares of every column."""
    out = np.zeros(matrix.shape[1])
    for row in range(matrix.shape[0]):
        for j in range(matrix.shape[1]):
            out[j] += matrix[row, j] * matrix[row, j]
    return out


@kernel
def _gram(matrix):  # type: ignore[no-untyped-def]
    """matrix' matrix, (b, b)."""
    count = matrix.shape[1]
    out = np.zeros((count, count))
    for row in range(matrix.shape[0]):
        for i in range(count):
            factor = matrix[row, i]
            if factor != 0.0:
                for j in range(i, count):
                    out[i, j] += factor * matrix[row, j]
    for i in range(count):
        for j in range(i):
            out[i, j] = out[j, i]
    return out


@kernel
def _times(matrix, factors):  # type: ignore[no-untyped-def]
    """matrix @ factors, (M, b)."""
    out = np.zeros(matrix.shape)
    for row in range(matrix.shape[0]):
        for i in range(matrix.shape[1]):
            factor = matrix[row, i]
            if factor != 0.0:
                for j in range(matrix.shape[1]):
                    out[row, j] += factor * factors[i, j]
    return out
