"""Drives that report the torque they gave: no gap, but a limit that is seen in what they report."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis.data.preparation import prepare
from diagnosis.diagnose import diagnose
from diagnosis.proposals.flat_top import flat_tops
from diagnosis.report.signature import signature
from identification.filtering import zero_phase_lowpass
from identification.inverse_dynamics import inverse_dynamics
from testbench.effects import parse_injection
from testbench.log import Recording
from testbench.robot import Robot
from tests.diagnosed import measured_only, simulated_runs

SHARE = 0.04


@pytest.fixture(scope="module")
def limit(arm: Robot) -> float:
    torque = np.concatenate([run.torque[:, 1] for run in simulated_runs(arm, [], runs=3).values()])
    return float(np.quantile(np.abs(torque), 1 - SHARE))


def _delivered(arm: Robot, limit: float, is_command_logged: bool) -> dict[str, Recording]:
    """Runs of an elbow's drive that clips and reports what it gave, noise and all."""
    fault = parse_injection(arm, f"torque_saturation:elbow:limit={limit}")
    rng, runs = np.random.default_rng(1), {}
    for name, run in simulated_runs(arm, [fault], runs=3, noise=0.0).items():
        torque = run.torque.copy()
        torque[:, 1] = np.clip(torque[:, 1], -limit, limit)
        torque += rng.normal(0, 0.01, torque.shape)
        command = run.torque_command if is_command_logged else None
        runs[name] = replace(run, torque=torque, torque_command=command)
    return runs


@pytest.mark.parametrize("is_command_logged", [True, False])
def test_the_limit_is_named_where_nothing_else_changes_the_torque(arm, limit, is_command_logged):
    found = diagnose(arm, _delivered(arm, limit, is_command_logged))
    assert [(e.effect, e.joint) for e in found.effects] == [("torque_saturation", 1)]
    # Four deviations of the level's median: 1.25 sigma / sqrt(samples at the limit), sigma 0.01 N·m.
    at_limit = SHARE * sum(len(run.time) for run in _delivered(arm, limit, False).values())
    tolerance = 4 * 1.25 * 0.01 / np.sqrt(at_limit)
    assert found.effects[0].parameters["limit"].value == pytest.approx(limit, abs=tolerance)
    assert "no gap" in found.sentence
    drawn = signature(found, found.effects[0])
    assert [trace.type for trace in drawn.data] == ["scatter", "bar"]
    assert {shape.y0 for shape in drawn.layout.shapes if shape.y0 == shape.y1} >= {
        found.effects[0].parameters["limit"].value
    }


def test_a_command_that_asks_for_no_more_is_no_limit(arm, limit):
    runs = {
        name: replace(run, torque_command=np.clip(run.torque, -limit, limit))
        for name, run in _delivered(arm, limit, True).items()
    }
    assert flat_tops(prepare(arm, runs), []) == []


def test_a_limit_that_the_model_has_is_no_gap(arm, limit):
    torque = np.array([arm.limits.torque[0], limit])
    limited = replace(arm, limits=replace(arm.limits, torque=torque))
    assert flat_tops(prepare(limited, _delivered(arm, limit, False)), []) == []


def test_friction_of_a_steady_sweep_is_no_limit(arm):
    """Up and down at one speed: the largest torque is friction's, for long, and again and again."""
    time = np.arange(20_000) / 1000
    speed = np.tanh(6 * np.sin(2 * np.pi * 0.1 * time))
    still = np.zeros_like(speed)
    q = np.column_stack([still, np.cumsum(speed) / 1000 - 2])
    dq = np.column_stack([still, speed])
    ddq = np.gradient(dq, time, axis=0)
    torque = inverse_dynamics(arm.chain, arm.parameters, q, dq, ddq)
    torque += np.random.default_rng(2).normal(0, 0.01, torque.shape)
    (run,) = simulated_runs(arm, [], runs=1).values()
    prepared = prepare(arm, {"sweep": replace(measured_only(run), time=time, position=q, torque=torque)})
    assert flat_tops(prepared, []) == []
    # For the same torque the motion alone decides: had gravity changed on the way, it would be a limit.
    lifted = replace(prepared.runs[0].logged, q=prepared.runs[0].logged.q + np.array([0.8, 0.0]))
    assert len(flat_tops(replace(prepared, runs=(replace(prepared.runs[0], logged=lifted),)), [])) == 1


def test_healthy_drives_have_none(arm):
    assert flat_tops(prepare(arm, simulated_runs(arm, [], runs=3)), []) == []


def test_a_pose_that_is_held_once_is_no_limit(arm):
    """One run rests where gravity is largest, the others pass as much torque on their way."""
    rng, runs = np.random.default_rng(5), simulated_runs(arm, [], runs=3)
    smooth = {name: zero_phase_lowpass(run.torque, run.sample_rate, 8.0) for name, run in runs.items()}
    highest = max(float(np.abs(torque[:, 1]).max()) for torque in smooth.values())
    for name, run in runs.items():
        torque = smooth[name] + rng.normal(0, 0.01, run.torque.shape)
        there = slice(1000, 2500) if name == "run_1" else [1200, 2400, 3600]
        torque[there, 1] = highest
        runs[name] = replace(run, torque=torque, torque_command=None)
    assert flat_tops(prepare(arm, runs), []) == []


def test_a_limit_shows_by_its_command_where_the_torque_rises_to_it_slowly(arm, limit):
    """Nearly as many samples just below the limit as at it: no flat top, but far more was asked for there."""
    runs = _delivered(arm, limit, True)
    for name, run in runs.items():
        assert run.torque_command is not None
        asked = np.abs(run.torque_command[:, 1])
        below = np.flatnonzero(asked < 0.9 * limit)[:150]
        torque, command = run.torque.copy(), run.torque_command.copy()
        torque[below, 1] = command[below, 1] = 0.985 * limit
        runs[name] = replace(run, torque=torque, torque_command=command)
    (found,) = flat_tops(prepare(arm, runs), [])
    assert found.member.shape["limit"] == pytest.approx(limit, rel=0.002)
    assert flat_tops(prepare(arm, {n: replace(r, torque_command=None) for n, r in runs.items()}), []) == []


def test_a_limit_shows_by_a_restless_command_that_was_sampled_apart_from_the_torque(arm, limit):
    """Where the command leaps from sample to sample, torque a sample late is short of it at any level."""
    runs, rng = _delivered(arm, limit, True), np.random.default_rng(3)
    for name, run in runs.items():
        assert run.torque_command is not None
        leaps = np.where(np.arange(len(run.time)) // 4 % 2, 0.3, -0.3) * limit
        command = run.torque_command.copy()
        command[:, 1] += leaps
        torque = np.roll(np.clip(command[:, 1], -limit, limit), 1) + rng.normal(0, 0.01, len(run.time))
        runs[name] = replace(run, torque=np.column_stack([run.torque[:, 0], torque]), torque_command=command)
    (found,) = flat_tops(prepare(arm, runs), [])
    assert found.member.shape["limit"] == pytest.approx(limit, rel=0.002)


@pytest.mark.parametrize("levels", [3.3, 7.4, 12.4])
def test_the_steps_of_a_coarse_log_are_no_limit(arm, levels):
    """A torque of few levels stays at the highest one while all else changes."""
    runs, coarse = simulated_runs(arm, [], runs=3), {}
    step = np.max([np.abs(run.torque).max(axis=0) for run in runs.values()], axis=0) / levels
    for name, run in runs.items():
        coarse[name] = replace(run, torque=step * np.round(run.torque / step), torque_command=None)
    assert flat_tops(prepare(arm, coarse), []) == []


def test_a_pose_that_is_held_at_rest_again_and_again_is_no_limit(arm):
    """Friction there has any sign, by the noise of the speed, and the drive goes on giving the same."""
    time = np.arange(20_000) / 1000
    up = np.clip(2 * np.sin(2 * np.pi * 0.2 * time) + 0.5, 0.0, 1.0)
    still = np.zeros_like(up)
    q = np.column_stack([still, 0.8 * zero_phase_lowpass(up[:, None], 1000, 5)[:, 0] - 2.3])
    dq = np.gradient(q, time, axis=0)
    torque = inverse_dynamics(arm.chain, arm.parameters, q, dq, np.gradient(dq, time, axis=0))
    rng = np.random.default_rng(2)
    torque += rng.normal(0, 0.01, torque.shape)
    q += rng.normal(0, 1e-5, q.shape)
    (run,) = simulated_runs(arm, [], runs=1).values()
    prepared = prepare(arm, {"held": replace(measured_only(run), time=time, position=q, torque=torque)})
    assert flat_tops(prepared, []) == []
