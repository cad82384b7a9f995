"""Columns with some of them taken out first."""

import numpy as np

from diagnosis.experiment.projection import projected_gram


def test_what_the_first_columns_span_is_taken_out_of_the_others():
    rows = np.random.default_rng(3).standard_normal((80, 4)) * [1.0, 1e4, 1e-6, 3.0]
    gram = projected_gram([rows[:32], rows[32:]], base=2)
    left = rows[:, 2:] - rows[:, :2] @ np.linalg.lstsq(rows[:, :2], rows[:, 2:])[0]
    np.testing.assert_allclose(gram[2:, 2:], left.T @ left, rtol=1e-6)


def test_columns_of_joints_that_stand_still_take_nothing_out():
    rows = np.random.default_rng(4).standard_normal((32, 3))
    rows[:, 0] = 0.0
    gram = projected_gram([rows], base=2)
    assert not gram[0].any()
    np.testing.assert_allclose(gram[1:, 1:], projected_gram([rows[:, 1:]], base=1), atol=1e-12)
