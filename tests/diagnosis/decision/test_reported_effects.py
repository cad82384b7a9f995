"""What has a name when it is taken in, and what still has one when all runs are fitted together."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from diagnosis.data.preparation import prepare
from diagnosis.decision.reported_effects import as_fitted_at_last, likely_faults
from diagnosis.model.base_regressor import BaseRegressor
from diagnosis.model.candidates import candidates
from identification.parameters import COULOMB, PER_JOINT

from ...diagnosed import simulated_runs
from ..accepted_effects import accepted_of


@pytest.fixture(scope="module")
def prepared(arm):
    return prepare(arm, simulated_runs(arm, [], runs=1))


@pytest.mark.parametrize(("share", "named"), [(0.12, True), (0.08, False)])
def test_what_all_runs_together_make_no_larger_than_a_healthy_joints_has_no_name(arm, prepared, share, named):
    taken_in = next(c for c in candidates(prepared, only=["stribeck_friction"]) if c.family.joint == 0)
    hypothesis = SimpleNamespace(
        prepared=prepared, base=BaseRegressor(prepared), parts=[slice(0, 1)], accepted=[taken_in]
    )
    fitted = SimpleNamespace(values=np.array([share * arm.parameters[COULOMB]]), wald=lambda part: 100.0)
    (item,) = as_fitted_at_last(arm, hypothesis, fitted, [accepted_of(taken_in)])
    assert item.named == named


def _likely(arm, prepared, shares, shifts=(0.0, 0.0)):
    """Stribeck friction of both joints, each so much of its Coulomb friction, as likely as it is a fault."""
    friction = candidates(prepared, only=["stribeck_friction"])
    both = [next(c for c in friction if c.family.joint == joint) for joint in range(2)]
    hypothesis = SimpleNamespace(
        prepared=prepared, base=BaseRegressor(prepared), parts=[slice(0, 1), slice(1, 2)], accepted=both
    )
    coulomb = arm.parameters[COULOMB::PER_JOINT]
    fitted = SimpleNamespace(values=np.array(shares) * coulomb)
    accepted = [replace(accepted_of(c), shift=shift) for c, shift in zip(both, shifts, strict=True)]
    return likely_faults(arm, hypothesis, fitted, accepted, ())


def test_an_effect_that_the_other_joint_has_as_well_is_the_robots(arm, prepared):
    alone, other = _likely(arm, prepared, (1.0, 0.02))
    assert (alone.named, other.named) == (True, False)
    assert (other.is_suspected, other.is_everywhere) == (True, False)
    for item in _likely(arm, prepared, (0.6, 0.6)):
        assert (item.named, item.is_everywhere) == (False, True)


def test_parameters_brought_back_from_where_another_effect_moved_them_are_no_evidence(arm, prepared):
    shares = (0.02, 0.25)
    _, back = _likely(arm, prepared, shares, shifts=(-40.0, 40.0))
    _, nearer = _likely(arm, prepared, shares, shifts=(0.0, 40.0))
    _, none = _likely(arm, prepared, shares)
    assert back.fault == none.fault < nearer.fault


@pytest.mark.parametrize(("wald", "named"), [(4.0, False), (25.0, True)])
def test_what_later_effects_leave_nothing_of_has_no_name(arm, prepared, wald, named):
    taken_in = next(c for c in candidates(prepared, only=["stribeck_friction"]) if c.family.joint == 0)
    hypothesis = SimpleNamespace(
        prepared=prepared, base=BaseRegressor(prepared), parts=[slice(0, 1)], accepted=[taken_in]
    )
    fitted = SimpleNamespace(values=np.array([arm.parameters[COULOMB]]), wald=lambda part: wald)
    (item,) = as_fitted_at_last(arm, hypothesis, fitted, [accepted_of(taken_in)])
    assert item.named == named
