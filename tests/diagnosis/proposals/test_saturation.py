"""Limits of drives and pushes: what makes a torque large without the motion showing it."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis.data.preparation import prepare
from diagnosis.fit.score import Stage
from diagnosis.model.base_regressor import BaseRegressor
from diagnosis.model.effect_sizes import quantities
from diagnosis.model.free_functions import generic_candidates
from diagnosis.model.gram import Bank
from diagnosis.proposals.saturation import cuts, saturation
from diagnosis.search.growth import attribute
from testbench.effects import parse_injection
from testbench.simulation import SimulationOptions, simulate
from testbench.simulation.reference import Reference

from ...diagnosed import RATE, simulated_runs


def _named(arm, runs):
    return [item for item in attribute(prepare(arm, runs)).accepted if item.named]


def _with_share_clipped(arm, share, law="clip"):
    torque = np.concatenate([run.torque for run in simulated_runs(arm, [], runs=3).values()])
    limit = float(np.quantile(np.abs(torque[:, 1]), 1 - share))
    text = f"torque_saturation:elbow:law={law},limit={limit}"
    return limit, simulated_runs(arm, [parse_injection(arm, text)], runs=3)


@pytest.mark.parametrize(
    ("share", "law", "tolerance"), [(0.05, "clip", 0.03), (0.02, "soft", 0.1), (0.5, "clip", 0.03)]
)
def test_a_limit_is_found_however_much_more_is_asked_for(arm, share, law, tolerance):
    limit, runs = _with_share_clipped(arm, share, law)
    first = _named(arm, runs)[0]
    assert first.candidate.place == ("torque_saturation", 1, None)
    found = quantities(first.candidate, np.ones(1))["limit"].value
    # A soft limit gives 92 % of itself where that is asked for.
    assert found == pytest.approx(limit, rel=tolerance)


def test_low_limits_are_tried_where_a_noisy_report_stays_at_its_peak(arm):
    rng, runs = np.random.default_rng(0), {}
    for name, run in simulated_runs(arm, [], runs=2).items():
        torque = run.torque.copy()
        held = run.time < 0.2 * run.time[-1]
        torque[held, 1] = rng.normal(30.0, 0.3, int(held.sum()))
        runs[name] = replace(run, torque=torque, torque_command=None)
    lowest = [min(each.limit for each in of_joint) for of_joint in cuts(prepare(arm, runs))]
    asked = [np.abs(np.concatenate([run.torque[:, joint] for run in runs.values()])) for joint in (0, 1)]
    assert lowest[1] < 0.05 * asked[1].max()
    # Of a motor that is never at its peak for long only the largest torques are tried.
    assert lowest[0] == pytest.approx(np.quantile(asked[0], 0.7), rel=0.05)


def test_a_limit_is_found_that_a_command_running_away_leaps_over(arm):
    runs = simulated_runs(arm, [], runs=3)
    most = max(np.abs(run.torque[:, 1]).max() for run in runs.values())
    least = float(np.quantile(np.abs(np.concatenate([run.torque[:, 1] for run in runs.values()])), 0.993))
    for name, run in runs.items():
        torque = run.torque.copy()
        away = np.abs(torque[:, 1]) > least
        torque[away, 1] = 3 * most * np.sign(torque[away, 1])
        runs[name] = replace(run, torque=torque, torque_command=None)
    prepared = prepare(arm, runs)
    stage = Stage.of(BaseRegressor(prepared), [])
    # None is tried near the limit itself.
    tried = [each for each in cuts(prepared)[1] if not 0.7 * most < each.limit < 2 * most]
    found = saturation(stage, Bank(stage.base, generic_candidates(prepared, [])), [[], tried])
    assert found is not None
    assert least < quantities(found.candidate, np.ones(1))["limit"].value < most


def test_a_limit_is_one_that_one_run_alone_passes_both_ways_in_quick_turn(arm):
    time = np.arange(5000) / RATE
    position = np.zeros((5000, arm.joints))
    position[:, 1] = 0.25 * np.sin(np.pi * time / 5) ** 2 * np.sin(2 * np.pi * 2.5 * time)
    velocity = np.gradient(position, 1 / RATE, axis=0)
    swing = Reference(position, velocity, np.gradient(velocity, 1 / RATE, axis=0))
    (swung,) = simulate(arm, [swing], SimulationOptions(physics_timestep=5e-4))
    runs = simulated_runs(arm, [], runs=2)
    limit = 1.05 * max(np.abs(run.torque[:, 1]).max() for run in runs.values())
    torque = swung.torque.copy()
    beyond = torque[:, 1] - np.clip(torque[:, 1], -limit, limit)
    # What is reported is what was asked for, and the arm moved as by the limit.
    torque[:, 1] += beyond
    assert 0.05 < np.mean(beyond != 0) < 0.3
    runs["swing"] = replace(swung, torque=torque, torque_command=None)
    prepared = prepare(arm, runs)
    stage = Stage.of(BaseRegressor(prepared), [])
    found = saturation(stage, Bank(stage.base, generic_candidates(prepared, [])), cuts(prepared))
    assert found is not None
    assert found.candidate.family.joint == 1


def test_a_limit_is_one_that_a_single_peak_passes(arm):
    (healthy,) = simulated_runs(arm, [], runs=1, seed=13).values()
    size = np.abs(healthy.torque[:, 1])
    apart = np.abs(healthy.time - healthy.time[size.argmax()]) > 0.5
    limit = 0.75 * float(size.max()) + 0.25 * float(size[apart].max())
    injection = parse_injection(arm, f"torque_saturation:elbow:limit={limit}")
    named = _named(arm, simulated_runs(arm, [injection], runs=1, seed=13))
    assert [item.candidate.place for item in named] == [("torque_saturation", 1, None)]
    assert quantities(named[0].candidate, np.ones(1))["limit"].value == pytest.approx(limit, rel=0.03)


def test_a_push_is_no_limit(arm):
    text = "external_contact:elbow:torque=6,start=3,duration=0.5"
    named = _named(arm, simulated_runs(arm, [parse_injection(arm, text)], runs=3))
    assert [item.candidate.place for item in named] == [("external_contact", 1, None)]


def test_a_healthy_arm_clips_nothing(arm):
    assert _named(arm, simulated_runs(arm, [], runs=3)) == []


@pytest.mark.filterwarnings("error::RuntimeWarning")
def test_a_joint_that_reports_no_torque_is_weighed_without_a_warning(arm):
    (run,) = simulated_runs(arm, [], runs=1).values()
    assert _named(arm, {"run_1": replace(run, torque=run.torque * [1.0, 0.0])}) == []


@pytest.mark.filterwarnings("error::RuntimeWarning")
def test_a_joint_that_stands_still_beside_one_that_clips_is_weighed_without_a_warning(arm):
    text = "torque_saturation:shoulder:limit=12"
    runs = {
        name: replace(run, position=run.position * [1.0, 0.0])
        for name, run in simulated_runs(arm, [parse_injection(arm, text)], runs=2).items()
    }
    assert [item for item in _named(arm, runs) if item.candidate.family.joint == 1] == []


def test_no_limit_lies_within_a_step_of_the_log(arm):
    step, coarse = 20.0, {}
    for name, run in simulated_runs(arm, [], runs=2).items():
        torque = run.torque.copy()
        torque[:, 1] = step * np.round(torque[:, 1] / step)
        coarse[name] = replace(run, torque=torque, torque_command=None)
    assert all(cut.limit > step for cut in cuts(prepare(arm, coarse))[1])
