"""What re-identification takes up, found in the parameters beside every joint's imperfections."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis.data.preparation import prepare
from diagnosis.fit.likelihood import weigh
from diagnosis.fit.normal_equations import fitted_to
from diagnosis.fit.score import Stage
from diagnosis.model.base_regressor import ground
from diagnosis.model.candidates import candidates
from diagnosis.model.gram import Bank
from diagnosis.search.absorbed_effects import swallowed
from testbench.effects import parse_injection

from ...diagnosed import simulated_runs


def test_all_imperfections_of_a_joint_are_fitted_beside_what_is_swallowed(arm):
    faults = (
        "transmission_ripple:elbow:amplitude=.1,cycles=21",
        "stribeck_friction:elbow:extra=.15,velocity=.2",
    )
    prepared = prepare(arm, simulated_runs(arm, [parse_injection(arm, text) for text in faults], 3))
    stage = Stage(ground(prepared), *fitted_to(prepared, []))
    beside, found = swallowed(stage, weigh(stage, Bank(stage.ground, candidates(prepared))))
    places = {each.place[:2] for each in beside.hypothesis.accepted}
    assert {("transmission_ripple", 1), ("stribeck_friction", 1)} <= places
    assert found == []


@pytest.mark.parametrize(
    ("joint", "relative"), [("shoulder", -0.15), ("elbow", 0.1), ("elbow", 0.2), ("elbow", 0)]
)
def test_a_gain_that_parameters_take_up_is_told_at_its_joint(arm, joint, relative):
    faults = [f"torque_gain_error:{joint}:relative={relative}"] if relative else []
    prepared = prepare(arm, simulated_runs(arm, [parse_injection(arm, text) for text in faults], runs=3))
    stage = Stage.of(ground(prepared), [])
    _, found = swallowed(stage, weigh(stage, Bank(stage.ground, candidates(prepared))))
    told = [each.candidate.place for each in found]
    assert told[:1] == ([("torque_gain_error", arm.joint_names.index(joint), None)] if relative else [])


@pytest.mark.parametrize(
    ("score", "evidence", "expected"), [(-4.0, 6.0, True), (-6.0, 29.0, False), (-60.0, 31.0, True)]
)
def test_what_left_out_runs_speak_against_must_add_more_to_all_of_them(
    arm, monkeypatch, score, evidence, expected
):
    fault = parse_injection(arm, "torque_gain_error:elbow:relative=0.2")
    prepared = prepare(arm, simulated_runs(arm, [fault], runs=3))
    stage = Stage.of(ground(prepared), [])
    gains = weigh(stage, Bank(stage.ground, candidates(prepared, only=["torque_gain_error"])))[:1]
    foretold, added = [replace(each, score=score) for each in gains], iter([0.0, evidence])
    monkeypatch.setattr("diagnosis.search.absorbed_effects.log_posterior", lambda *_: next(added))
    monkeypatch.setattr("diagnosis.search.absorbed_effects.weigh", lambda *_: foretold)
    _, found = swallowed(stage, gains)
    assert bool(found) == expected


@pytest.mark.parametrize(("shift", "expected"), [(29.0, False), (31.0, True)])
def test_what_spares_the_parameters_a_large_shift_is_fitted_in_full(arm, monkeypatch, shift, expected):
    fault = parse_injection(arm, "torque_gain_error:elbow:relative=0.2")
    prepared = prepare(arm, simulated_runs(arm, [fault], runs=3))
    stage = Stage.of(ground(prepared), [])
    gains = weigh(stage, Bank(stage.ground, candidates(prepared, only=["torque_gain_error"])))[:1]
    spared = [
        replace(each, score=-60.0, gain=replace(each.gain, prior=stage.prior + shift)) for each in gains
    ]
    added = iter([0.0, 40.0])
    monkeypatch.setattr("diagnosis.search.absorbed_effects.log_posterior", lambda *_: next(added))
    monkeypatch.setattr("diagnosis.search.absorbed_effects.weigh", lambda *_: spared)
    # As if what is left of it in the torque told little.
    monkeypatch.setattr("diagnosis.search.absorbed_effects.WORTH_A_FIT_AGAINST", np.inf)
    _, found = swallowed(stage, gains)
    assert bool(found) == expected


@pytest.mark.parametrize(
    ("fault", "evidence", "expected"),
    [
        ("torque_gain_error:elbow:relative=0.1", 5.0, True),
        ("torque_gain_error:elbow:relative=0.1", 4.0, False),
        ("payload::mass=0.5", 15.0, False),
        ("payload::mass=0.5", 16.0, True),
    ],
)
def test_many_coefficients_must_add_more_than_one(arm, monkeypatch, fault, evidence, expected):
    prepared = prepare(arm, simulated_runs(arm, [parse_injection(arm, fault)], runs=3))
    stage = Stage.of(ground(prepared), [])
    weighed = weigh(stage, Bank(stage.ground, candidates(prepared, only=[fault.split(":")[0]])))[:1]
    added = iter([0.0, evidence])
    monkeypatch.setattr("diagnosis.search.absorbed_effects.log_posterior", lambda *_: next(added))
    monkeypatch.setattr("diagnosis.search.absorbed_effects.weigh", lambda *_: weighed)
    _, found = swallowed(stage, weighed)
    assert bool(found) == expected
