"""What is fitted moves from the model only as far as left-out rows are predicted no worse."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from identification.shrinkage import (
    STRENGTHS,
    Products,
    held_change,
    left_out_changes,
    shrinkage,
    shrinkage_factor,
)

Array = NDArray[np.float64]
FOLDS, ROWS, UNKNOWNS = 4, 60, 3


def products(rows: Array, torque: Array) -> Products:
    """Of one joint: rows (F, m, p), torque (F, m)."""
    return Products(
        np.einsum("fma,fmb->fab", rows, rows)[:, None],
        np.einsum("fma,fm->fa", rows, torque)[:, None],
        np.sum(torque**2, axis=1)[:, None],
    )


def drawn(seed: int, change: Array, noise: float) -> Products:
    rng = np.random.default_rng(seed)
    rows = rng.standard_normal((FOLDS, ROWS, UNKNOWNS))
    return products(rows, rows @ change + noise * rng.standard_normal((FOLDS, ROWS)))


def left_out_square(of: Products, changes: Array) -> float:
    xx, xy, yy = of.weighted(np.ones(1))
    return float(yy.sum() - 2 * np.sum(changes * xy) + np.einsum("fa,fab,fb->", changes, xx, changes))


def test_a_direction_without_rows_keeps_the_models_value() -> None:
    rows = np.random.default_rng(0).standard_normal((FOLDS, ROWS, UNKNOWNS))
    rows[:, :, 2] = 0.0
    of = products(rows, rows @ np.array([1.0, -2.0, 5.0]))
    xx, xy, _ = of.weighted(np.ones(1))
    change = held_change(xx.sum(axis=0), xy.sum(axis=0), np.eye(UNKNOWNS), STRENGTHS[-1])
    np.testing.assert_allclose(change, [1.0, -2.0, 0.0], atol=1e-3)
    assert change[2] == 0.0


def test_a_change_that_every_fold_confirms_is_made_whole() -> None:
    change = np.array([1.0, -2.0, 0.5])
    found = shrinkage(drawn(1, change, 0.01), np.full(1, 100.0), np.eye(UNKNOWNS), [np.ones(1)])
    assert found.factor == pytest.approx(1.0, abs=1e-3)
    assert found.errors[0, 2] < 0.02


def test_folds_that_contradict_each_other_leave_the_model_as_given() -> None:
    rows = np.random.default_rng(2).standard_normal((2, ROWS, UNKNOWNS))
    torque = rows @ np.ones(UNKNOWNS)
    torque[1] *= -1
    found = shrinkage(products(rows, torque), np.full(1, 10.0), np.eye(UNKNOWNS), [np.ones(1)])
    assert found.factor == 0.0
    assert found.errors[0, 2] == 1.0


def test_the_factor_is_the_least_of_the_error() -> None:
    of = drawn(3, np.array([0.2, 0.0, -0.1]), 1.0)
    changes = 3 * left_out_changes(of, np.ones(1), np.eye(UNKNOWNS), 0.01)
    zero = np.zeros_like(changes)
    best = shrinkage_factor(of, [np.ones(1)], zero, changes)
    tried = np.linspace(0, 1, 2001)
    assert best == pytest.approx(
        tried[np.argmin([left_out_square(of, a * changes) for a in tried])], abs=6e-4
    )


@settings(max_examples=50, deadline=None)
@given(st.integers(0, 10_000), st.floats(0.0, 2.0), st.floats(0.01, 10.0))
def test_left_out_rows_are_never_predicted_worse_than_by_the_model(
    seed: int, size: float, weight: float
) -> None:
    of = drawn(seed, np.array([size, 0.0, -size]), 1.0)
    found = shrinkage(of, np.full(1, weight), np.eye(UNKNOWNS), [np.ones(1)])
    assert found.errors[0, 2] <= 1 + 1e-9
    assert found.errors[0, 2] <= found.errors[0, 1] + 1e-9
