"""Logs whose torque is late against their positions: reported, taken back, and no effect of the robot."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis.correction.corrected_model import corrected_model
from diagnosis.correction.prediction import predict_torque
from diagnosis.data.preparation import prepare
from diagnosis.data.run import Prepared
from diagnosis.diagnose import diagnose
from diagnosis.fit.normal_equations import fitted_to
from diagnosis.fit.torque_alignment import aligned, lateness
from diagnosis.model.base_regressor import BaseRegressor
from diagnosis.report import notes
from testbench.effects import parse_injection
from testbench.log import Recording
from testbench.torque_lag import IN_TIME, TorqueLag

from ...diagnosed import measured_only, simulated_runs

# Samples of a millisecond.
LATE, FAR_LATE = 12, 80


def _late(runs: dict[str, Recording], samples: int) -> dict[str, Recording]:
    """The runs with their torque so many samples late, or early."""
    return {name: replace(run, torque=np.roll(run.torque, samples, axis=0)) for name, run in runs.items()}


def _timing(prepared: Prepared) -> tuple[float, float]:
    """How late the torque is, s, by the unknown timing, and its deviation."""
    hypothesis, fitted = fitted_to(BaseRegressor(prepared), [])
    place = hypothesis.timing
    return float(fitted.values[place]), float(np.sqrt(fitted.covariance[place, place]))


@pytest.mark.parametrize("samples", [LATE, FAR_LATE])
def test_late_torque_is_taken_back_as_far_as_it_is_late(arm, healthy_runs, samples):
    own, deviation = _timing(prepare(arm, healthy_runs))
    prepared = aligned(arm, _late(healthy_runs, samples))
    left, _ = _timing(prepared)
    # A deviation of either, and a tenth of a sample for torque that is a line between two of them.
    assert prepared.lag.seconds + left == pytest.approx(
        1e-3 * samples + own, abs=5 * np.sqrt(2) * deviation + 1e-4
    )
    assert prepared.runs[0].logged.samples == prepare(arm, healthy_runs).runs[0].logged.samples - samples


@pytest.mark.parametrize("samples", [-8, -1, 0, 1])
def test_torque_that_is_early_or_hardly_late_is_left(arm, healthy_runs, samples):
    assert lateness(prepare(arm, _late(healthy_runs, samples))) == IN_TIME


@pytest.mark.parametrize(("order", "corner"), [(1, 10.0), (2, 10.0)])
def test_a_low_pass_is_found_with_its_corner_and_taken_back(arm, healthy_runs, order, corner):
    lag = TorqueLag(order=order, time_constant=1 / (2 * np.pi * corner))
    passed = {
        name: replace(run, torque=lag.put_on(run.torque, run.sample_rate))
        for name, run in healthy_runs.items()
    }
    found = diagnose(arm, passed)
    own = found.prepared.lag
    assert (own.delay, own.order) == (0.0, order)
    # Torque that is half a sample off is as much more or less through the low-pass.
    half = 0.5e-3 / TorqueLag(order=order, time_constant=1.0).seconds
    assert own.time_constant == pytest.approx(lag.time_constant, abs=half)
    assert found.verdict in ("none", "parameters")
    assert f"as through a low-pass at {own.corner:.3g} Hz" in notes.late(found)[0]
    model, rate = corrected_model(found), healthy_runs["run_1"].sample_rate
    predicted, logged = predict_torque(model, passed["run_1"]).corrected, passed["run_1"].torque
    settled = slice(int(0.2 * rate), None)
    left = np.sqrt(np.mean((logged - predicted)[settled] ** 2, axis=0))
    assert np.all(left < 0.05 * np.sqrt(np.mean(logged[settled] ** 2, axis=0)))


def test_lateness_is_no_effect_of_a_healthy_robot(arm, healthy_runs):
    found = diagnose(arm, _late(healthy_runs, LATE))
    assert found.verdict in ("none", "parameters")
    assert "ms late" in notes.late(found)[0]
    assert not notes.late(diagnose(arm, healthy_runs))


def test_an_effect_is_named_in_late_logs_and_predicted_as_late(arm):
    faulty = simulated_runs(
        arm, [parse_injection(arm, "transmission_ripple:elbow:amplitude=0.6,cycles=12")], runs=3
    )
    known = {name: measured_only(faulty[name]) for name in ("run_1", "run_2")}
    along = faulty["run_3"]
    in_time, late = diagnose(arm, known), diagnose(arm, _late(known, LATE))
    assert [(each.effect, each.joint) for each in late.effects] == [("transmission_ripple", 1)]
    plain, shifted = (predict_torque(corrected_model(each), along).corrected for each in (in_time, late))
    apart = shifted[LATE:] - plain[:-LATE]
    assert np.all(np.sqrt(np.mean(apart**2, axis=0)) < 0.02 * np.sqrt(np.mean(plain**2, axis=0)))
