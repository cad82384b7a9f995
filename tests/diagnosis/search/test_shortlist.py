"""What is fitted in full beside a hypothesis: the likeliest, what fits best, all imperfections."""

import pytest

from diagnosis.data.preparation import prepare
from diagnosis.fit.likelihood import log_likelihood, weigh
from diagnosis.fit.score import Stage
from diagnosis.model.base_regressor import BaseRegressor
from diagnosis.model.candidates import candidates
from diagnosis.model.gram import Bank
from diagnosis.proposals import laws
from diagnosis.search import shortlist
from diagnosis.search.shortlist import choose
from testbench.effects import parse_injection

from ...diagnosed import simulated_runs


def test_what_fits_a_joint_best_is_listed_though_it_was_not_material(arm):
    cable = parse_injection(arm, "cable_spring:elbow:stiffness=2,rest=0.4")
    prepared = prepare(arm, simulated_runs(arm, [cable]))
    stage = Stage.of(BaseRegressor(prepared), [])
    springs = candidates(prepared, only=["cable_spring", "gravity_spring"])
    open_ = weigh(stage, Bank(stage.base, [each for each in springs if each.family.joint == 1]))
    material = [each for each in open_ if each.candidate.family.effect == "gravity_spring"]
    chosen = choose(arm, stage, material, open_)
    assert chosen is not None
    best, rivals, _ = chosen
    assert best.candidate.family.effect == "cable_spring"
    assert [each.candidate.family.effect for each, _ in rivals] == ["gravity_spring"]


def test_what_left_out_runs_leave_at_the_wrong_shape_is_moved_by_all_runs_together(arm, monkeypatch):
    """Or another spring of the joint would explain what the wrong shape leaves."""
    cable = parse_injection(arm, "cable_spring:elbow:law=hysteretic,stiffness=3,rest=0.4")
    prepared = prepare(arm, simulated_runs(arm, [cable], runs=3))
    stage = Stage.of(BaseRegressor(prepared), [])
    cables = [each for each in candidates(prepared, only=["cable_spring"]) if each.family.joint == 1]
    (proposed,) = weigh(stage, Bank(stage.base, cables))
    # Left-out runs look no further than this.
    monkeypatch.setattr(laws, "search", lambda *found: None)
    chosen = choose(arm, stage, [proposed], [proposed])
    assert chosen is not None
    wanted = {"friction": pytest.approx(0.2, rel=0.1), "yields": pytest.approx(0.1, rel=0.2)}
    assert proposed.candidate.member.shape != wanted
    assert chosen[0].candidate.member.shape == wanted


@pytest.mark.parametrize(("joint", "relative"), [("shoulder", 0.05), ("elbow", 0.05), ("elbow", -0.1)])
def test_whose_gain_is_off_is_found_by_all_runs_together(arm, joint, relative):
    """At one of two joints it makes up for the other's: left-out runs may take the wrong one for likelier."""
    fault = parse_injection(arm, f"torque_gain_error:{joint}:relative={relative}")
    prepared = prepare(arm, simulated_runs(arm, [fault], runs=3))
    stage = Stage.of(BaseRegressor(prepared), [])
    gains = weigh(stage, Bank(stage.base, candidates(prepared, only=["torque_gain_error"])))
    chosen = choose(arm, stage, gains, gains)
    assert chosen is not None
    best, ((rival, _),), _ = chosen
    assert arm.joint_names[best.candidate.family.joint] == joint
    assert rival.candidate.family.joint == 1 - best.candidate.family.joint


def test_which_error_an_encoder_has_is_found_by_all_runs_together(arm, monkeypatch):
    """Where a joint turns little, an eccentric encoder has most of an offset in it, and one unknown more."""
    prepared = prepare(arm, simulated_runs(arm, [parse_injection(arm, "encoder_offset:elbow:offset=0.03")]))
    stage = Stage.of(BaseRegressor(prepared), [])
    errors = candidates(prepared, only=["encoder_offset", "encoder_eccentricity"])
    weighed = weigh(stage, Bank(stage.base, [each for each in errors if each.family.joint == 1]))

    def by_chance(hypothesis, fitted):
        eccentric = "encoder_eccentricity" in [each.family.effect for each in hypothesis.accepted]
        return log_likelihood(hypothesis, fitted) + 60.0 * eccentric

    monkeypatch.setattr(shortlist, "log_likelihood", by_chance)
    chosen = choose(arm, stage, weighed, weighed)
    assert chosen is not None
    assert chosen[0].candidate.family.effect == "encoder_offset"


@pytest.mark.parametrize(("name", "is_found"), [("torque_delay", True), ("actuator_lag", False)])
def test_a_delay_in_the_place_of_the_timing_is_found_by_all_runs_together(arm, monkeypatch, name, is_found):
    """Left-out runs may be predicted worse by it: the prior keeps the timing alone near its size."""
    prepared = prepare(arm, simulated_runs(arm, [parse_injection(arm, "torque_delay::delay=0.004")]))
    stage = Stage.of(BaseRegressor(prepared), [])
    weighed = weigh(stage, Bank(stage.base, candidates(prepared, only=[name])))[:1]
    # The more that was taken in, the worse.
    monkeypatch.setattr(shortlist, "log_likelihood", lambda hypothesis, _: -99.0 * len(hypothesis.accepted))
    assert (choose(arm, stage, weighed, weighed) is not None) == is_found


@pytest.mark.parametrize(("evidence", "is_found"), [(29.0, False), (31.0, True)])
def test_what_bends_all_parameters_is_found_by_all_runs_where_left_out_ones_lose(
    arm, monkeypatch, evidence, is_found
):
    """Where the one fast run is left out, parameters are extrapolated to it."""
    prepared = prepare(
        arm, simulated_runs(arm, [parse_injection(arm, "torque_gain_error:elbow:relative=0.2")])
    )
    stage = Stage.of(BaseRegressor(prepared), [])
    weighed = weigh(stage, Bank(stage.base, candidates(prepared, only=["torque_gain_error"])))[:1]
    monkeypatch.setattr(shortlist, "log_likelihood", lambda hypothesis, _: -99.0 * len(hypothesis.accepted))
    monkeypatch.setattr(shortlist, "log_posterior", lambda hypothesis, _: evidence * len(hypothesis.accepted))
    assert (choose(arm, stage, weighed, weighed) is not None) == is_found


@pytest.mark.parametrize(("stiffness", "doubling"), [(100, 0.004), (100, 0.02), (100, None), (40, 0.08)])
def test_a_spring_that_hardens_is_found_by_its_own_law(arm, stiffness, doubling):
    law = "law=two_mass" if doubling is None else f"law=hardening,doubling_windup={doubling}"
    spring = parse_injection(arm, f"joint_elasticity:elbow:stiffness={stiffness},damping=0.2,{law}")
    prepared = prepare(arm, simulated_runs(arm, [spring], runs=3))
    stage = Stage.of(BaseRegressor(prepared), [])
    weighed = weigh(stage, Bank(stage.base, candidates(prepared, only=["joint_elasticity"])))
    chosen = choose(arm, stage, weighed, weighed)
    assert chosen is not None
    found = chosen[0].candidate
    assert (found.family.joint, found.member.law) == (1, None if doubling is None else "hardening")
    assert found.member.shape["stiffness"] == pytest.approx(stiffness, rel=0.1)
    if doubling is not None:
        assert found.member.shape["doubling_windup"] == pytest.approx(doubling, rel=0.1)


@pytest.mark.parametrize(
    ("fault", "without", "rivals"),
    [
        ("torque_delay:elbow:delay=0.01", (), {"torque_delay"}),
        ("torque_delay:elbow:delay=0.002", (), {"torque_delay"}),
        ("torque_delay:elbow:delay=0.01", ("torque_delay",), set()),
        ("actuator_lag:elbow:time_constant=0.012", (), set()),
    ],
)
def test_a_joint_that_is_late_alone_lags_and_may_be_late(arm, fault, without, rivals):
    prepared = prepare(arm, simulated_runs(arm, [parse_injection(arm, fault)], runs=3))
    stage = Stage.of(BaseRegressor(prepared), [])
    weighed = weigh(stage, Bank(stage.base, candidates(prepared, only=["actuator_lag"])))
    chosen = choose(arm, stage, weighed[:1], weighed, without)
    assert chosen is not None
    best, others, _ = chosen
    assert best.candidate.place == ("actuator_lag", 1, None)
    assert {other.candidate.family.effect for other, probability in others if probability > 0.1} == rivals
    # But drives lag far more often.
    assert all(probability < 0.15 for _, probability in others)


@pytest.mark.parametrize(
    ("law", "found"),
    [
        ("law=hardening,stiffness=1,doubling=0.5", {"hardening"}),
        ("law=hardening,stiffness=3,doubling=9", {None, "hysteretic"}),
    ],
)
def test_a_cable_hardens_where_no_line_will_do(arm, law, found):
    prepared = prepare(
        arm, simulated_runs(arm, [parse_injection(arm, f"cable_spring:elbow:rest=0.4,{law}")], runs=3)
    )
    stage = Stage.of(BaseRegressor(prepared), [])
    every = candidates(prepared, only=["cable_spring"])
    hoses = [each for each in every if each.family.joint == 1 and each.member.law == "hardening"]
    weighed = weigh(stage, Bank(stage.base, hoses))
    chosen = choose(arm, stage, weighed, weighed)
    assert chosen is not None
    assert chosen[0].candidate.member.law in found
