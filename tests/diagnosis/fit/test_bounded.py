"""Quadratics within bounds meet the conditions of Karush, Kuhn and Tucker."""

import numpy as np
import pytest

from diagnosis.fit.bounded import minimisers, solve


@pytest.mark.parametrize("seed", range(20))
def test_the_minimum_within_bounds_has_no_way_down(seed):
    generator = np.random.default_rng(seed)
    unknowns = int(generator.integers(3, 60))
    rows = generator.normal(size=(3 * unknowns, unknowns))
    matrix, right = rows.T @ rows, 10 * generator.normal(size=unknowns)
    lower, upper = np.full(unknowns, -np.inf), np.full(unknowns, np.inf)
    bounded = generator.permutation(unknowns)[: generator.integers(1, unknowns + 1)]
    lower[bounded] = -generator.uniform(0, 0.05, len(bounded))
    upper[bounded[::2]] = generator.uniform(0, 0.05, len(bounded[::2]))
    upper[bounded[::5]] = lower[bounded[::5]]
    found = solve(matrix, right, lower, upper)
    slope = (matrix @ found - right) / np.abs(right).max()
    # Relative rounding of the ridge that keeps Cholesky's factor.
    rounding = 1e-9
    assert np.all((found >= lower - rounding) & (found <= upper + rounding))
    assert np.all(slope[found > lower + rounding] < rounding)
    assert np.all(slope[found < upper - rounding] > -rounding)
    assert np.any(np.abs(slope) > rounding)


@pytest.mark.filterwarnings("error")
def test_a_column_that_is_next_to_nothing_has_no_coefficient():
    """A law that has died out everywhere but for a denormal number, beside one that acts."""
    squares = np.array([[2e-314], [4.0]])
    matrix, right = np.array([[[0.0]], [[4.0]]]), np.array([[0.0], [8.0]])
    lower, upper = np.zeros((2, 1)), np.full((2, 1), np.inf)
    found = minimisers(matrix, right, squares, lower, upper)
    assert found[:, 0] == pytest.approx([0.0, 2.0])
