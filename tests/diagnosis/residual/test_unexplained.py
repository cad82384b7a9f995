"""What no effect explains, where no function of the motion does either."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import signal
from scipy.interpolate import CubicSpline

from diagnosis.data.preparation import prepare
from diagnosis.diagnose import diagnose
from diagnosis.fit.likelihood import Weighed
from diagnosis.fit.score import Stage
from diagnosis.model.base_regressor import BaseRegressor
from diagnosis.model.candidate import FREE
from diagnosis.model.free_functions import RUN_TIME, generic_candidates
from diagnosis.model.gram import Bank
from diagnosis.residual.shares import NOTHING
from diagnosis.residual.unexplained import TIMING, unclaimed
from identification.parameters import ARMATURE
from testbench.effects import parse_injection
from testbench.effects.logged import logged_run

from ...diagnosed import measured_only, simulated_runs
from ...small_arm import SCARA, small_arm
from ..certain_gain import certain, squares

SLOWER = 20


def _unclaimed(arm, runs):
    prepared = prepare(arm, runs)
    stage = Stage.of(BaseRegressor(prepared), [])
    free = Bank(stage.base, generic_candidates(prepared))
    left = np.sqrt(stage.held_squares / stage.counts) / stage.base.torque_rms
    return unclaimed(stage, stage, free), left


@pytest.mark.parametrize(("stiffness", "expected"), [(1500, False), (350, True)])
def test_what_is_slow_and_large_is_unknown_though_every_joint_has_as_much(tmp_path, stiffness, expected):
    arm = small_arm(tmp_path)
    fault = parse_injection(arm, f"joint_elasticity:shoulder:stiffness={stiffness},damping=4")
    found, _ = _unclaimed(arm, simulated_runs(arm, [fault], runs=3))
    assert ((0, NOTHING) in [(each.joint, each.regime) for each in found]) == expected


@pytest.mark.parametrize(("share", "verdict"), [(0.06, "effect"), (0.12, "unknown")])
def test_what_follows_nothing_is_the_verdict_where_it_is_far_more_than_what_has_a_name(
    tmp_path, share, verdict
):
    arm = small_arm(tmp_path, SCARA)
    ripple = parse_injection(arm, "transmission_ripple:turn:amplitude=1.5,cycles=9,phase=0.3")
    found = diagnose(arm, _wandering(simulated_runs(arm, [ripple], runs=3), share))
    assert found.verdict == verdict


def _wandering(runs, share):
    """Runs with so much of the second joint's torque beside it, slow, that nothing predicts."""
    rng, found = np.random.default_rng(1), {}
    for name, run in runs.items():
        knots = np.arange(run.time[0], run.time[-1] + 0.2, 0.2)
        wandering = CubicSpline(knots, rng.normal(size=len(knots)))(run.time)
        torque = run.torque.copy()
        torque[:, 1] += share * np.std(torque[:, 1]) * wandering / np.std(wandering)
        found[name] = replace(run, torque=torque)
    return found


@pytest.mark.parametrize(("share", "expected"), [(0.08, True), (0.02, False)])
def test_what_shakes_one_joint_now_and_then_far_more_than_noise_is_unknown(tmp_path, share, expected):
    """Too fast for a part of the motion, too slow for noise, and nothing predicts when."""
    arm = small_arm(tmp_path, SCARA)
    runs, rng = simulated_runs(arm, [], runs=3), np.random.default_rng(2)
    for name, run in runs.items():
        shaken = _bandpass(rng.normal(size=len(run.time)), run.sample_rate)
        torque = run.torque.copy()
        torque[:, 1] += share * np.std(torque[:, 1]) * shaken / np.std(shaken)
        runs[name] = replace(run, torque=torque)
    found, _ = _unclaimed(arm, runs)
    assert [(each.joint, each.regime) for each in found] == ([(1, NOTHING)] if expected else [])


@pytest.mark.parametrize(("late", "expected"), [(-5, True), (5, False)])
def test_torque_that_acts_late_is_unknown_and_what_is_logged_late_is_of_the_log(tmp_path, late, expected):
    arm = small_arm(tmp_path)
    runs = {name: measured_only(run) for name, run in simulated_runs(arm, [], runs=3).items()}
    inside = slice(10, -10)
    for name, run in runs.items():
        torque = np.roll(run.torque, late, axis=0)[inside]
        runs[name] = replace(run, time=run.time[inside], position=run.position[inside], torque=torque)
    found, _ = _unclaimed(arm, runs)
    assert (TIMING in [each.regime for each in found]) == expected


def _bandpass(values, rate):
    """What of them is between 5 and 14 Hz."""
    return signal.sosfiltfilt(signal.butter(4, (5.0, 14.0), "bandpass", fs=rate, output="sos"), values)


def test_noise_is_nothing_however_large(tmp_path):
    arm = small_arm(tmp_path)
    found, left = _unclaimed(arm, simulated_runs(arm, [], runs=3, noise=6.0))
    assert left.max() > 0.05
    assert found == ()


@pytest.mark.parametrize(("wald", "expected"), [(25.0, False), (60.0, True)])
def test_a_function_that_all_runs_fit_by_chance_predicts_by_chance(tmp_path, monkeypatch, wald, expected):
    arm = small_arm(tmp_path)
    prepared = prepare(arm, simulated_runs(arm, [], runs=3))
    stage, free = Stage.of(BaseRegressor(prepared), []), generic_candidates(prepared)
    own = next(c for c in free if c.family.effect == FREE + RUN_TIME and c.family.joint == 0)
    assert 10 < own.count < wald
    stage.held_squares = squares(stage, 0.1)
    gain = certain(stage, own, 1.0, np.array([0.4, 0.0]) * stage.held_squares, wald)
    monkeypatch.setattr("diagnosis.residual.unexplained.weigh", lambda *_: [Weighed(gain, 50.0)])
    found = unclaimed(stage, stage, Bank(stage.base, free))
    assert ((0, RUN_TIME) in [(each.joint, each.regime) for each in found]) == expected


@pytest.mark.parametrize(
    ("noise", "heavier_by"), [(0.05, 1.0), (4.0, 0.15), (6.0, 0.15), (6.0, 0.2), (6.0, 0.4)]
)
def test_a_run_that_parameters_are_extrapolated_to_is_not_unknown(tmp_path, noise, heavier_by):
    """One run alone is fast: without it nothing determines the inertia, which the model has wrong."""
    arm = small_arm(tmp_path)
    heavier = arm.parameters.copy().reshape(arm.joints, -1)
    heavier[:, ARMATURE] += heavier_by
    fast, *others = simulated_runs(arm, [], runs=3, noise=0.05).values()
    slow = []
    for run in others:
        position = CubicSpline(SLOWER * run.time[::20], run.position[::20])(run.time)
        slow.append(replace(run, position=position))
    runs = {}
    for index, run in enumerate([fast, *slow]):
        plain = measured_only(run)
        along = logged_run(arm, plain, heavier.ravel(), 40.0)
        rng = np.random.default_rng(index)
        runs[f"run_{index}"] = replace(plain, torque=along.predicted + rng.normal(0, noise, along.q.shape))
    found, left = _unclaimed(arm, runs)
    assert left.max() > 0.1
    assert found == ()


@pytest.mark.parametrize(("loss", "expected"), [(0.0, False), (0.2, True)])
def test_what_follows_the_torque_that_a_drive_gives_is_unknown(tmp_path, loss, expected):
    """An iron core that saturates gives the less for its current the more it is to give."""
    arm = small_arm(tmp_path)
    runs = {}
    for name, run in simulated_runs(arm, [], runs=3).items():
        asked = run.torque / arm.limits.torque
        runs[name] = replace(measured_only(run), torque=run.torque * (1 + loss * (asked / 0.3) ** 2))
    found, _ = _unclaimed(arm, runs)
    assert ("torque" in [each.regime for each in found]) == expected


@pytest.mark.parametrize("levels", [24, 60])
def test_the_rounding_of_a_coarse_log_is_not_unknown(tmp_path, levels):
    arm = small_arm(tmp_path)
    step = 2 * arm.limits.torque / levels
    runs = simulated_runs(arm, [], runs=3)
    coarse = {name: replace(run, torque=step * np.round(run.torque / step)) for name, run in runs.items()}
    found, left = _unclaimed(arm, coarse)
    assert left.max() > 0.02
    assert found == ()
