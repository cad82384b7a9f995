"""One shape of an effect on some runs: the bounds of its coefficients."""

import numpy as np
import pytest

from diagnosis.data.preparation import prepare
from diagnosis.fit.normal_equations import fitted_to
from diagnosis.model.base_regressor import BaseRegressor
from diagnosis.model.candidate import MOST_TORQUE
from diagnosis.model.candidates import candidates
from diagnosis.model.hypothesis import bounds

from ...diagnosed import simulated_runs
from ...small_arm import small_arm


@pytest.fixture(scope="module")
def prepared(tmp_path_factory):
    arm = small_arm(tmp_path_factory.mktemp("arm"))
    return prepare(arm, simulated_runs(arm, [], runs=2))


@pytest.mark.parametrize("name", ["stribeck_friction", "transmission_ripple", "cable_spring"])
def test_an_effect_takes_no_torque_that_its_joint_never_had(prepared, name):
    for each in candidates(prepared, only=[name]):
        (lower, upper), member = each.bounds, each.member
        row = list(member.rows)
        peak = np.max([np.abs(run).max(axis=0) for run in each.filtered], axis=0)
        most = MOST_TORQUE * prepared.largest_torque[row, None]
        assert np.all(upper * peak <= most * (1 + 1e-9))
        assert np.all(-lower * peak <= most * (1 + 1e-9))
        assert np.all((lower >= member.lower) & (upper <= member.upper))


def test_a_fit_keeps_these_bounds(prepared):
    each = next(c for c in candidates(prepared, only=["stribeck_friction"]))
    hypothesis, fitted = fitted_to(BaseRegressor(prepared), [each])
    np.testing.assert_array_equal([side[-1:] for side in bounds(hypothesis)], each.bounds)
    assert each.bounds[0][0] <= fitted.values[-1] <= each.bounds[1][0]
