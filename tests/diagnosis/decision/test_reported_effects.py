"""What has a name when it is taken in, and what still has one when all runs are fitted together."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from diagnosis.data.preparation import prepare
from diagnosis.decision.reported_effects import as_fitted_at_last
from diagnosis.model.candidates import candidates
from identification.parameters import COULOMB

from ...diagnosed import simulated_runs
from ..accepted_effects import accepted_of


@pytest.fixture(scope="module")
def prepared(arm):
    return prepare(arm, simulated_runs(arm, [], runs=1))


@pytest.mark.parametrize(("seconds", "named"), [(2.0, False), (10.0, True)])
def test_a_joint_that_warms_faster_than_any_by_all_runs_together_has_no_name(arm, prepared, seconds, named):
    (taken_in, *_) = candidates(prepared, only=["thermal_friction_drift"])
    shape = taken_in.member.shape | {"time_constant": seconds}
    final = replace(taken_in, member=replace(taken_in.member, shape=shape))
    hypothesis = SimpleNamespace(prepared=prepared, parts=[slice(0, taken_in.count)], accepted=[final])
    fitted = SimpleNamespace(values=0.5 * np.eye(taken_in.count)[0], wald=lambda part: 100.0)
    (item,) = as_fitted_at_last(arm, hypothesis, fitted, [accepted_of(taken_in)])
    assert item.named == named
    assert item.candidate is final


@pytest.mark.parametrize(
    ("share", "by_size", "named"), [(0.12, True, True), (0.08, True, False), (0.08, False, True)]
)
def test_what_all_runs_together_make_no_larger_than_a_healthy_joints_has_no_name_for_its_size(
    arm, prepared, share, by_size, named
):
    taken_in = next(c for c in candidates(prepared, only=["stribeck_friction"]) if c.family.joint == 0)
    hypothesis = SimpleNamespace(prepared=prepared, parts=[slice(0, 1)], accepted=[taken_in])
    fitted = SimpleNamespace(values=np.array([share * arm.parameters[COULOMB]]), wald=lambda part: 100.0)
    sized = replace(accepted_of(taken_in), by_size=by_size)
    (item,) = as_fitted_at_last(arm, hypothesis, fitted, [sized])
    assert item.named == named


@pytest.mark.parametrize(("wald", "named"), [(4.0, False), (25.0, True)])
def test_what_later_effects_leave_nothing_of_has_no_name(arm, prepared, wald, named):
    taken_in = next(c for c in candidates(prepared, only=["stribeck_friction"]) if c.family.joint == 0)
    hypothesis = SimpleNamespace(prepared=prepared, parts=[slice(0, 1)], accepted=[taken_in])
    fitted = SimpleNamespace(values=np.array([arm.parameters[COULOMB]]), wald=lambda part: wald)
    (item,) = as_fitted_at_last(arm, hypothesis, fitted, [accepted_of(taken_in)])
    assert item.named == named
