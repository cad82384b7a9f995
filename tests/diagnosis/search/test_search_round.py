"""What may be taken in at all, and what of it is certain."""

from dataclasses import replace

import pytest

from diagnosis.data.preparation import prepare
from diagnosis.decision.reported_effects import Found
from diagnosis.fit.likelihood import Weighed, weigh
from diagnosis.fit.score import Stage
from diagnosis.model.base_regressor import BaseRegressor
from diagnosis.model.candidates import candidates
from diagnosis.model.gram import Bank
from diagnosis.search.search_round import Search
from testbench.effects import parse_injection

from ...diagnosed import simulated_runs
from ...small_arm import small_arm


def test_what_all_runs_together_fit_as_nothing_is_not_open(tmp_path):
    arm = small_arm(tmp_path)
    prepared = prepare(arm, simulated_runs(arm, [], runs=3))
    stage = Stage.of(BaseRegressor(prepared), [])
    # Neither can be less than nothing, so noise alone often fits them as just that.
    bounded = Bank(stage.base, candidates(prepared, only=["actuator_lag", "joint_elasticity"]))
    assert any(each.gain.wald < 1e-3 for each in weigh(stage, bounded))
    opened = Search(stage.fitted, arm, [], ()).open(stage, bounded)
    assert all(each.gain.wald > 1 for each in opened)


@pytest.mark.parametrize(("time_constant", "expected"), [(0.002, False), (0.012, True)])
def test_what_is_held_at_a_bound_above_zero_is_not_open(tmp_path, time_constant, expected):
    arm = small_arm(tmp_path)
    lag = f"actuator_lag:elbow:law=second_order,time_constant={time_constant}"
    prepared = prepare(arm, simulated_runs(arm, [parse_injection(arm, lag)], runs=3))
    stage = Stage.of(BaseRegressor(prepared), [])
    # Two like stages of 4 ms at least, though one of 2 ms would be better than none.
    two_stages = [each for each in candidates(prepared, only=["actuator_lag"]) if each.member.law]
    opened = Search(stage.fitted, arm, [], ()).open(stage, Bank(stage.base, two_stages))
    assert any(each.candidate.family.joint == 1 for each in opened) == expected


@pytest.mark.parametrize(("limit", "expected"), [(80.0, "torque_saturation"), (60.0, "external_contact")])
def test_a_push_is_one_where_a_limit_of_its_drive_explains_far_less(tmp_path, monkeypatch, limit, expected):
    arm = small_arm(tmp_path)
    prepared = prepare(arm, simulated_runs(arm, [], runs=2))
    stage = Stage.of(BaseRegressor(prepared), [])
    own = weigh(stage, Bank(stage.base, candidates(prepared, only=["asymmetric_friction"])))[0]

    def seen_as(name, score):
        made = replace(own.gain.candidate, family=replace(own.gain.candidate.family, effect=name))
        return Weighed(replace(own.gain, candidate=made), score)

    pushed = Found(seen_as("external_contact", 100.0), (), stage.with_effects([own.candidate]))
    monkeypatch.setattr(Search, "push", lambda *_: pushed)
    monkeypatch.setattr(
        "diagnosis.search.search_round.saturation", lambda *_: seen_as("torque_saturation", limit)
    )
    found = Search(stage.fitted, arm, [], ()).round(stage, [], Bank(stage.base, []))
    assert found is not None
    assert found.best.candidate.family.effect == expected


@pytest.mark.parametrize(("nearly_all", "expected"), [(0.9, "joint_coupling"), (1.1, "torque_saturation")])
def test_a_shared_drive_that_its_other_joint_tells_is_taken_in_before_a_limit(
    arm, monkeypatch, nearly_all, expected
):
    shared = parse_injection(arm, "joint_coupling:shoulder:into=elbow,viscous=0.8,coulomb=0.8")
    prepared = prepare(arm, simulated_runs(arm, [shared], runs=3))
    stage = Stage.of(BaseRegressor(prepared), [])
    weighed = weigh(stage, Bank(stage.base, candidates(prepared, only=["joint_coupling"])))
    friction = candidates(prepared, only=["asymmetric_friction"])
    own = next(stage.gain(each) for each in friction if each.family.joint == 1)
    limit = replace(own.candidate, family=replace(own.candidate.family, effect="torque_saturation"))
    clipped = Weighed(replace(own, candidate=limit), 1e6)
    monkeypatch.setattr("diagnosis.search.search_round.NEARLY_ALL", nearly_all)
    monkeypatch.setattr("diagnosis.search.search_round.saturation", lambda *_: clipped)
    monkeypatch.setattr(Search, "push", lambda *_: None)
    found = Search(stage.fitted, arm, [], ()).round(stage, weighed, Bank(stage.base, []))
    assert found is not None
    assert found.best.candidate.family.effect == expected
