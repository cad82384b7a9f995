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
from scipy.linalg import solve_triangular

from ..errors import InputError
from ..kinematics import kernel

Array = NDArray[np.float64]

# Multiplications of a block's product, and numbers of all blocks' products that are held at once.
BLOCK_PRODUCT, GRAM_NUMBERS = 1 << 17, 1 << 20
RIDGE = 1e-13
SWEEPS, EIGEN_TOLERANCE = 30, 1e-28

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
    norms = np.einsum("ij,ij->j", weighted, weighted)
    _require_excited(norms)
    return -float(np.sum(np.log(norms / samples))), weighted * (-2.0 / norms)


def condition(weighted: Array, samples: int) -> tuple[float, Array]:
    """log cond of W with unit columns, and its gradient (M, b). ``samples`` has no effect on it.

    With C v = l v of the scaled Gram matrix C, dl/dw_j = 2 v_j / |w_j| (W~ v - l v_j w~_j).
    """
    gram, scale = _scaled_gram(weighted)
    values, vectors = _eigen(gram)
    factors = np.zeros(gram.shape)
    for index, sign in ((-1, 1.0), (0, -1.0)):
        v = vectors[:, index]
        factors += sign * (np.outer(v, v) / values[index] - np.diag(v * v))
    return 0.5 * float(np.log(values[-1] / values[0])), _times(weighted, factors / np.outer(scale, scale))


def logdet(weighted: Array, samples: int) -> tuple[float, Array]:
    """-log det(W'W / N) and its gradient -2 W (W'W)^-1, (M, b)."""
    gram, scale = _scaled_gram(weighted)
    lower = np.linalg.cholesky(gram)
    inverse_lower = solve_triangular(lower, np.eye(len(scale)), lower=True) / scale
    value = -2.0 * float(np.sum(np.log(np.diag(lower) * scale)) - 0.5 * len(scale) * np.log(samples))
    return value, _times(weighted, -2.0 * inverse_lower.T @ inverse_lower)


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


def _scaled_gram(weighted: Array) -> tuple[Array, Array]:
    """Gram matrix (b, b) of W with unit columns, and the norms (b,) of the columns."""
    gram = _gram(weighted)
    norms = np.diag(gram).copy()
    _require_excited(norms)
    scale = np.sqrt(norms)
    # At rounding level, so that collinear columns give a huge value instead of a failure.
    return gram / np.outer(scale, scale) + RIDGE * np.eye(len(scale)), scale


def _require_excited(norms: Array) -> None:
    if not np.all(norms > 0):
        count = int(np.sum(~(norms > 0)))
        raise InputError(
            "excitation", "motion", "a motion that moves every base parameter", f"{count} unexcited"
        )


def _eigen(matrix: Array) -> tuple[Array, Array]:
    """Eigenvalues (b,) ascending and vectors (b, b) in columns of a symmetric matrix."""
    diagonal, rows = matrix.copy(), np.eye(len(matrix))
    _jacobi(diagonal, rows)
    values = np.diag(diagonal)
    order = np.argsort(values)
    return values[order], rows[order].T


# Not LAPACK's: for matrices of this size it starts threads, which cost more than they save.
@kernel
def _jacobi(matrix: Array, vectors: Array) -> None:
    """Make a symmetric matrix diagonal by cyclic Jacobi rotations; rows of ``vectors`` turn along.

    Golub & Van Loan, "Matrix Computations", 2013, section 8.5.
    """
    size = matrix.shape[0]
    for _ in range(SWEEPS):
        turned = False
        for i in range(size):
            for j in range(i + 1, size):
                off = matrix[i, j]
                if off * off <= EIGEN_TOLERANCE * abs(matrix[i, i] * matrix[j, j]):
                    continue
                turned = True
                ratio = (matrix[j, j] - matrix[i, i]) / (2.0 * off)
                tangent = (1.0 if ratio >= 0.0 else -1.0) / (abs(ratio) + np.sqrt(1.0 + ratio * ratio))
                cosine = 1.0 / np.sqrt(1.0 + tangent * tangent)
                sine = tangent * cosine
                for k in range(size):
                    first, second = matrix[k, i], matrix[k, j]
                    matrix[k, i] = cosine * first - sine * second
                    matrix[k, j] = sine * first + cosine * second
                _rotate(matrix, i, j, cosine, sine)
                _rotate(vectors, i, j, cosine, sine)
        if not turned:
            return


@kernel
def _rotate(rows: Array, i: int, j: int, cosine: float, sine: float) -> None:
    """Turn rows i and j of a matrix into each other."""
    for k in range(rows.shape[1]):
        first, second = rows[i, k], rows[j, k]
        rows[i, k] = cosine * first - sine * second
        rows[j, k] = sine * first + cosine * second


def _blocks(matrix: Array) -> Array:
    """matrix (M, b) as (blocks, rows, b), the last block filled with zeros.

    A block's products are too small for BLAS to share among threads, which could change the order
    of its sums; so the result does not depend on the number of threads.
    """
    rows = max(8, BLOCK_PRODUCT // matrix.shape[1] ** 2)
    count = -(-len(matrix) // rows)
    out = np.zeros((count, rows, matrix.shape[1]))
    out.reshape(count * rows, -1)[: len(matrix)] = matrix
    return out


def _gram(matrix: Array) -> Array:
    """matrix' matrix, (b, b)."""
    found, blocks = np.zeros(2 * [matrix.shape[1]]), _blocks(matrix)
    # The blocks' own products of many joints are more than the memory holds.
    at_once = max(1, GRAM_NUMBERS // found.size)
    for first in range(0, len(blocks), at_once):
        some = blocks[first : first + at_once]
        found += np.sum(some.transpose(0, 2, 1) @ some, axis=0)
    return found


def _times(matrix: Array, factors: Array) -> Array:
    """matrix (M, b) @ factors (b, b), (M, b)."""
    return (_blocks(matrix) @ factors).reshape(-1, matrix.shape[1])[: len(matrix)]
