"""What has a name when it is taken in, and what still has one when all runs are fitted together."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from diagnosis.data.preparation import prepare
from diagnosis.decision.reported_effects import as_fitted_at_last, couples, is_borne_out
from diagnosis.fit.score import Stage
from diagnosis.model.base_regressor import ground
from diagnosis.model.candidates import candidates
from identification.parameters import COULOMB
from testbench.effects import parse_injection

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


@pytest.mark.parametrize(
    ("own", "other", "certain", "named"),
    [(0.08, 0.06, True, True), (0.08, 0.09, True, False), (0.08, 0.09, False, True), (0.12, 0.2, True, True)],
)
def test_what_was_alone_has_no_name_beside_as_much_at_another_joint(
    arm, prepared, own, other, certain, named
):
    """Shares of each joint's Coulomb friction; a tenth is what a healthy joint may have."""
    shoulder, elbow = (
        next(c for c in candidates(prepared, only=["stribeck_friction"]) if c.family.joint == joint)
        for joint in (0, 1)
    )
    hypothesis = SimpleNamespace(
        prepared=prepared, parts=[slice(0, 1), slice(1, 2)], accepted=[shoulder, elbow]
    )
    coulomb = arm.parameters.reshape(arm.joints, -1)[:, COULOMB]
    fitted = SimpleNamespace(values=np.array([own, other]) * coulomb, wald=lambda part: 100.0)
    alone = replace(accepted_of(shoulder), is_alone=True)
    beside = replace(accepted_of(elbow, named=False), is_certain=certain)
    first, _ = as_fitted_at_last(arm, hypothesis, fitted, [alone, beside])
    assert first.named == named


@pytest.mark.parametrize(("wald", "named"), [(4.0, False), (25.0, True)])
def test_what_later_effects_leave_nothing_of_has_no_name(arm, prepared, wald, named):
    taken_in = next(c for c in candidates(prepared, only=["stribeck_friction"]) if c.family.joint == 0)
    hypothesis = SimpleNamespace(prepared=prepared, parts=[slice(0, 1)], accepted=[taken_in])
    fitted = SimpleNamespace(values=np.array([arm.parameters[COULOMB]]), wald=lambda part: wald)
    (item,) = as_fitted_at_last(arm, hypothesis, fitted, [accepted_of(taken_in)])
    assert item.named == named


@pytest.mark.parametrize(
    ("coulomb", "least", "nearly_all", "moves"),
    [
        (0.05, 0.025, 1.1, False),
        (0.8, 0.025, 1.1, True),
        # What moves its joints less is shared where it is all that is left, and far beyond a healthy robot's.
        (0.4, 1.0, 1.1, False),
        (0.8, 1.0, 1.1, True),
        # Or where it is all but all, and beyond one by the joint of less friction.
        (0.4, 1.0, 0.95, True),
        (0.05, 1.0, 0.95, False),
    ],
)
def test_a_shared_drive_moves_one_of_its_joints(arm, monkeypatch, coulomb, least, nearly_all, moves):
    shared = parse_injection(arm, f"joint_coupling:shoulder:into=elbow,viscous=0,coulomb={coulomb}")
    prepared = prepare(arm, simulated_runs(arm, [shared]))
    stage = Stage.of(ground(prepared), [])
    gain = stage.gain(candidates(prepared, only=["joint_coupling"])[0])
    monkeypatch.setattr("diagnosis.decision.reported_effects.LEAST_COUPLED", least)
    monkeypatch.setattr("diagnosis.decision.reported_effects.NEARLY_ALL_COUPLED", nearly_all)
    assert couples(arm, stage, gain) == moves


@pytest.mark.parametrize(
    ("name", "share", "shift", "is_named"),
    [
        ("encoder_offset", 0.03, 2.0, True),
        ("encoder_offset", 0.9, -2.0, False),
        ("cable_spring", 0.05, 31.0, False),
        ("cable_spring", 0.2, -2.0, True),
        ("gravity_spring", 0.05, -2.0, True),
    ],
)
def test_an_offset_bends_the_parameters_and_a_cable_foretells_something(name, share, shift, is_named):
    assert is_borne_out(name, share, shift) == is_named
