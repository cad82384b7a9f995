"""When a push is seen before the effects that would be taken for it."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from diagnosis.data.preparation import prepare
from diagnosis.data.run import Prepared
from diagnosis.diagnose import diagnose
from diagnosis.fit.normal_equations import squares
from diagnosis.fit.score import Stage
from diagnosis.model.base_regressor import BaseRegressor
from diagnosis.model.candidate import Candidate
from diagnosis.model.candidates import candidates
from diagnosis.model.free_functions import generic_candidates
from diagnosis.model.gram import Bank
from diagnosis.proposals.contact import contact, explains_all_bursts
from diagnosis.search.growth import attribute
from testbench.effects import parse_injection
from testbench.effects.link_force import independent

from ...diagnosed import simulated_runs
from ...small_arm import small_arm

PUSH = "external_contact:elbow:law=world_force,torque=20,start=1.5,duration=0.6"


def with_pushes(folder: Path, pushes: dict[str, str]) -> Prepared:
    """Runs of an arm, prepared, of which those named are pushed."""
    arm = small_arm(folder)
    runs = simulated_runs(arm, [], runs=3)
    for name, push in pushes.items():
        runs[name] = simulated_runs(arm, [parse_injection(arm, push)], runs=3)[name]
    return prepare(arm, runs)


def _sought(prepared: Prepared, accepted: Sequence[Candidate] = ()):
    """The stage that has these effects, and the push that is seen beside them."""
    stage = Stage.of(BaseRegressor(prepared), accepted)
    return stage, contact(stage, Bank(stage.base, generic_candidates(prepared)))


@pytest.fixture(scope="module")
def pushed(tmp_path_factory):
    return with_pushes(tmp_path_factory.mktemp("arm"), {"run_2": PUSH})


@pytest.mark.parametrize(("left", "expected"), [((0.1, 0.1), True), ((0.1, 1.0), False), ((1.0, 0.1), False)])
def test_it_must_explain_the_bursts_of_all_joints(pushed, left, expected):
    stage = Stage.of(BaseRegressor(pushed), [])
    residual = tuple(run * left for run in stage.fitted.residual)
    assert explains_all_bursts(stage, replace(stage.fitted, residual=residual)) == expected


def test_it_is_taken_in_before_what_would_imitate_it(pushed):
    first, *others = attribute(pushed).accepted
    assert first.candidate.is_event
    assert not any(each.named for each in others)


@pytest.mark.parametrize(("start", "reason"), [(0, "fitted, but only where runs begin"), (1500, "")])
def test_what_is_there_as_a_run_begins_and_never_after_is_no_push_by_name(tmp_path, start, reason):
    arm = small_arm(tmp_path)
    runs = simulated_runs(arm, [], runs=3)
    torque = runs["run_2"].torque.copy()
    torque[start : start + 700, 0] += 8.0
    runs["run_2"] = replace(runs["run_2"], torque=torque)
    found = diagnose(arm, runs)
    assert [each.effect for each in found.effects] == ([] if reason else ["external_contact"])
    (pushed,) = [each for each in found.ranked if each.effect == "external_contact" and each.joint == 0]
    assert pushed.reason.startswith(reason)
    assert bool(pushed.reason) == bool(reason)


def test_a_push_less_than_a_third_as_hard_in_another_run_is_fitted_too(tmp_path):
    prepared = with_pushes(tmp_path, {"run_2": PUSH, "run_3": PUSH.replace("torque=20", "torque=6")})
    _, found = _sought(prepared)
    assert found is not None
    assert [bool(columns.any()) for columns in found[0].gain.candidate.member.columns] == [False, True, True]


def test_a_push_is_held_against_noise_no_more_than_there_is(tmp_path):
    arm = small_arm(tmp_path)
    weak = parse_injection(arm, PUSH.replace("torque=20", "torque=4"))
    runs = simulated_runs(arm, [], runs=3, noise=0.15)
    runs["run_2"] = simulated_runs(arm, [weak], runs=3, noise=0.15)["run_2"]
    prepared = prepare(arm, runs)
    stage, found = _sought(prepared)
    assert found is not None
    # Of all that is left it explains little, and of what is no noise all.
    left = squares(found[2][1].residual) / squares(stage.fitted.residual)
    assert left.min() > 0.3


@pytest.mark.parametrize(
    ("first", "law", "expected"),
    [
        ("stribeck_friction", "joint_torque", True),
        ("torque_saturation", "joint_torque", False),
        ("presliding_hysteresis", "joint_torque", False),
        # Bristles of one joint leave nothing at another.
        ("presliding_hysteresis", "world_force", True),
    ],
)
def test_bursts_beside_a_limit_or_bristles_are_their_rest(tmp_path, first, law, expected):
    prepared = with_pushes(tmp_path, {"run_2": PUSH.replace("law=world_force", f"law={law}")})
    friction = next(c for c in candidates(prepared, only=["stribeck_friction"]) if c.family.joint == 1)
    named = replace(friction, family=replace(friction.family, effect=first))
    _, found = _sought(prepared, [named])
    assert (found is not None) == expected


def test_a_push_is_seen_where_friction_near_rest_leaves_more_than_it(tmp_path):
    arm = small_arm(tmp_path)
    runs = simulated_runs(arm, [], runs=3)
    push = parse_injection(arm, PUSH.replace("torque=20", "torque=8"))
    pushed = simulated_runs(arm, [push], runs=3)["run_2"]
    # Samples that do not count: the joint turns.
    still = np.abs(np.gradient(pushed.position, 1e-3, axis=0)) < 0.04
    runs["run_2"] = replace(pushed, torque=pushed.torque + np.where(still, 60.0, 0.0))
    prepared = prepare(arm, runs)
    _, found = _sought(prepared)
    assert found is not None
    rubbed = found[0].gain.candidate.member.columns[1].any(axis=(1, 2))
    first, last = np.flatnonzero(rubbed)[[0, -1]] / 1000
    assert 1.3 < first < 1.6
    assert 2.0 < last < 2.3


@pytest.mark.parametrize(("fitted", "expected"), [(0.6, True), (0.8, False)])
def test_a_function_of_the_motion_that_fits_most_is_likelier_than_a_push(
    pushed, monkeypatch, fitted, expected
):
    monkeypatch.setattr(
        "diagnosis.proposals.contact.fitted_shares", lambda *_: np.full(pushed.joints, fitted)
    )
    _, found = _sought(pushed)
    assert (found is not None) == expected


def test_a_push_is_sought_where_a_function_of_the_motion_fits_more_than_of_a_shock(tmp_path, monkeypatch):
    """In one run some function fits most of a push."""
    arm = small_arm(tmp_path)
    push = parse_injection(arm, PUSH.replace("elbow", "shoulder"))
    runs = simulated_runs(arm, [], runs=3)
    runs["run_2"] = simulated_runs(arm, [push], runs=3)["run_2"]
    torque = runs["run_1"].torque.copy()
    torque[2000:2030, 1] += 12.0
    prepared = prepare(arm, {**runs, "run_1": replace(runs["run_1"], torque=torque)})
    monkeypatch.setattr("diagnosis.proposals.contact.fitted_shares", lambda *_: np.array([0.6, 0.4]))
    _, found = _sought(prepared)
    assert found is not None
    assert found[0].candidate.family.joint == 0
    monkeypatch.setattr("diagnosis.proposals.contact.fitted_shares", lambda *_: np.array([0.85, 0.4]))
    assert _sought(prepared)[1] is None


def test_a_shock_that_the_filter_does_not_resolve_is_no_push(tmp_path):
    arm = small_arm(tmp_path)
    runs = simulated_runs(arm, [], runs=3)
    torque = runs["run_2"].torque.copy()
    torque[2000:2030, 1] += 12.0
    runs["run_2"] = replace(runs["run_2"], torque=torque)
    prepared = prepare(arm, runs)
    _, found = _sought(prepared)
    assert found is None


def test_a_push_is_of_the_link_whose_joint_it_loads_though_another_shakes_at_other_times(tmp_path):
    arm = small_arm(tmp_path)
    push = parse_injection(arm, PUSH.replace("elbow", "shoulder").replace("duration=0.6", "duration=1.5"))
    runs = simulated_runs(arm, [], runs=3)
    runs["run_2"] = simulated_runs(arm, [push], runs=3)["run_2"]
    for name, starts in {"run_1": (500, 1400, 2400), "run_2": (1700, 3600)}.items():
        torque = runs[name].torque.copy()
        for start in starts:
            torque[start : start + 100, 1] += 3.0
        runs[name] = replace(runs[name], torque=torque)
    prepared = prepare(arm, runs)
    _, found = _sought(prepared)
    assert found is not None
    assert found[0].candidate.family.joint == 0


def test_a_profile_that_is_not_ours_tells_of_no_farther_link(tmp_path):
    arm = small_arm(tmp_path)
    runs = simulated_runs(arm, [], runs=3)
    torque = runs["run_2"].torque.copy()
    since = np.linspace(0.0, 1.0, 800)
    torque[1500:2300, 0] += 8.0 * np.clip(np.minimum(since, 1.0 - since) / 0.3, 0.0, 1.0)
    runs["run_2"] = replace(runs["run_2"], torque=torque)
    prepared = prepare(arm, runs)
    _, found = _sought(prepared)
    assert found is not None
    assert found[0].candidate.family.joint == 0


@pytest.mark.parametrize(("limit", "expected"), [(20.0, True), (2.0, False), (np.inf, True)])
def test_no_push_is_many_times_what_a_drive_withstands(pushed, limit, expected):
    limits = replace(pushed.robot.limits, torque=np.full(pushed.joints, limit))
    runs = tuple(replace(run, logged=replace(run.logged, limits=limits)) for run in pushed.runs)
    weak = replace(pushed, runs=runs)
    _, found = _sought(weak)
    assert (found is not None) == expected


def test_loads_of_a_push_are_distinguished_by_what_each_joint_withstands():
    torques = np.random.default_rng(0).normal(size=(50, 2, 3)) * np.array([1.0, 4.0])[:, None]
    withstood = np.array([1.0, 0.1])
    loads = (torques @ independent(torques, withstood)) / withstood[:, None]
    # None of them is large at the weak joint alone: what it bears counts as much as the strong one's.
    np.testing.assert_allclose(np.einsum("mra,mrb->ab", loads, loads) / 50, np.eye(3), atol=1e-9)
