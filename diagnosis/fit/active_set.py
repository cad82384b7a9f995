"""Normal equations inverted along the unknowns that are at none of their bounds."""

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve

from .bounded import ROUNDING

Array = NDArray[np.float64]


def at_bounds(values: Array, bounds: tuple[Array, Array]) -> NDArray[np.bool_]:
    """Mask (p,) of the unknowns that are at one of their bounds."""
    lower, upper = bounds
    nearness = ROUNDING * np.abs(values)
    return (values <= lower + nearness) | (values >= upper - nearness)


class Inverse:
    """Products with the inverse of a symmetric positive definite matrix, scaled against its units.

    fixed: (p,) unknowns that stay where they are; of them it says zero.
    """

    def __init__(self, matrix: Array, fixed: NDArray[np.bool_]):
        self.fixed = fixed
        matrix = np.where(fixed[:, None] | fixed, 0.0, matrix)
        matrix[fixed, fixed] = 1.0
        diagonal = np.diag(matrix)
        self.scale = 1 / np.sqrt(np.where(diagonal > 0, diagonal, 1.0))
        scaled = matrix * np.outer(self.scale, self.scale)
        scaled[np.diag_indices_from(scaled)] += ROUNDING
        self.factor = cho_factor(scaled, lower=True)

    def times(self, right: Array) -> Array:
        """Inverse times right, (p,) or (p, k)."""
        free = ~self.fixed if right.ndim == 1 else ~self.fixed[:, None]
        scale = self.scale if right.ndim == 1 else self.scale[:, None]
        return np.where(free, scale * cho_solve(self.factor, scale * np.where(free, right, 0.0)), 0.0)
