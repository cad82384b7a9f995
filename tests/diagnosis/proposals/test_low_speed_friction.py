"""Coulomb friction that is smooth near rest, as others simulate it and as encoders show it, is no effect."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from diagnosis.correction.corrected_mjcf import write_corrected
from diagnosis.correction.corrected_model import corrected_model
from diagnosis.correction.prediction import predict_torque
from diagnosis.data.preparation import prepare
from diagnosis.data.run import Prepared
from diagnosis.diagnose import diagnose
from diagnosis.fit.score import Stage
from diagnosis.model.base_regressor import BaseRegressor
from diagnosis.model.gram import Bank
from diagnosis.proposals.low_speed_friction import (
    GUESSED,
    NearRest,
    lead_candidates,
    near_rest,
    soft_candidates,
    with_friction_near_rest,
)
from diagnosis.search.growth import attribute
from identification.parameters import COULOMB
from testbench.effects import parse_injection
from testbench.effects.logged import logged_run
from testbench.log import Recording
from testbench.robot import Robot

from ...diagnosed import measured_only, simulated_runs

WIDTH, SHOULDER, NOISE = 0.08, 0, 0.01


def _soft(arm: Robot, faults: tuple[str, ...] = ()) -> dict[str, Recording]:
    """Runs of an arm whose shoulder has fc tanh(v / w) in place of fc sgn v, with noise."""
    rng, runs = np.random.default_rng(4), {}
    injected = [parse_injection(arm, fault) for fault in faults]
    level = arm.parameters.reshape(arm.joints, -1)[SHOULDER, COULOMB]
    for name, run in simulated_runs(arm, injected, runs=3, noise=0.0).items():
        v = logged_run(arm, run, arm.parameters, 80.0).dq[:, SHOULDER]
        torque = run.torque + rng.normal(0, NOISE, run.torque.shape)
        torque[:, SHOULDER] += level * (np.tanh(v / WIDTH) - np.sign(v))
        runs[name] = replace(run, torque=torque)
    return runs


def _found(prepared: Prepared) -> NearRest:
    """What is soft beside re-identification alone, were there no effects to rival it."""
    stage = Stage.of(BaseRegressor(prepared), [])
    proposed = lead_candidates(prepared), soft_candidates(prepared)
    banks = [Bank(stage.base, each) for each in proposed]
    return near_rest(stage, [], *banks) or NearRest()


def test_the_width_is_found_to_what_noise_allows(arm):
    prepared = prepare(arm, _soft(arm))
    found = _found(prepared)
    # Cramér-Rao: how the filtered torque goes with ln w, by its noise behind the low-pass.
    level, step = arm.parameters.reshape(arm.joints, -1)[SHOULDER, COULOMB], 1e-3
    slope, variance = [], []
    for run in prepared.runs:
        v = run.logged.dq[:, [SHOULDER]]
        change = np.tanh(v / (WIDTH * (1 + step))) - np.tanh(v / (WIDTH * (1 - step)))
        of_width = run.filtered(level * change / (2 * step), [SHOULDER])[:, 0]
        slope.append(of_width[run.used[:, SHOULDER]])
        variance.append(NOISE**2 * float(np.sum(run.filters[SHOULDER].taps ** 2)))
    # Twice over for neighbours that share noise, and for what Coulomb and viscous friction take up.
    deviation = 2 * np.sqrt(max(variance) / np.sum(np.concatenate(slope) ** 2))
    assert abs(np.log(found.widths[SHOULDER] / WIDTH)) < 4 * deviation + np.log(1.02)


def test_friction_that_jumps_is_not_soft(arm):
    prepared = prepare(arm, simulated_runs(arm, [], runs=3))
    assert _found(prepared) == NearRest()


def test_a_width_once_known_is_not_found_again(arm):
    prepared = prepare(arm, _soft(arm))
    assert _found(with_friction_near_rest(prepared, _found(prepared))) == NearRest()


def test_what_is_slower_than_the_form_is_sure_does_not_count(arm):
    prepared = prepare(arm, _soft(arm))
    for before, run in zip(
        prepared.runs, with_friction_near_rest(prepared, NearRest({SHOULDER: WIDTH})).runs, strict=True
    ):
        slow = np.abs(run.dq[:, SHOULDER]) <= GUESSED * WIDTH
        assert not np.any(run.used[slow, SHOULDER])
        assert np.array_equal(run.used[:, 1:], before.used[:, 1:])


def test_soft_friction_has_no_name(arm):
    found = diagnose(arm, _soft(arm))
    assert found.verdict in ("none", "parameters")
    assert found.prepared.coulomb_smoothing[SHOULDER] == pytest.approx(WIDTH, rel=0.05)


def test_an_effect_beside_it_is_named_alone(arm):
    found = attribute(prepare(arm, _soft(arm, ("transmission_ripple:elbow:amplitude=0.6,cycles=12",))))
    named = [(a.candidate.family.effect, a.candidate.family.joint) for a in found.accepted if a.named]
    assert named == [("transmission_ripple", 1)]


def test_it_is_predicted_and_said_not_to_be_in_the_simulator(arm, tmp_path):
    runs = _soft(arm)
    found = diagnose(arm, runs)
    assert any(
        "soft near rest" in sentence for sentence in write_corrected(found, tmp_path / "corrected.xml").lacks
    )
    run = next(iter(runs.values()))
    left = predict_torque(corrected_model(found), run).corrected[:, SHOULDER] - run.torque[:, SHOULDER]
    v = logged_run(arm, run, arm.parameters, 80.0).dq[:, SHOULDER]
    slow = (np.abs(v) < WIDTH) & (np.abs(v) > 0.02)
    level = arm.parameters.reshape(arm.joints, -1)[SHOULDER, COULOMB]
    # A jump would be off by half of the Coulomb friction and more there.
    assert np.sqrt(np.mean(left[slow] ** 2)) < 0.1 * level


@pytest.mark.parametrize(("slower", "extra"), [(3, 1.0), (6, 1.0)])
def test_what_steep_falling_friction_leaves_is_not_soft(arm, slower, extra):
    """Exponent three, which no member has: what is left of it beside a Gaussian looks soft near rest."""
    runs = {}
    for index, (name, run) in enumerate(simulated_runs(arm, [], runs=3, noise=0.0).items()):
        time = np.arange(0.0, 3 * run.time[-1], 1 / run.sample_rate)
        position = CubicSpline(slower * run.time[::20], run.position[::20])(time)
        zero = np.zeros_like(position)
        plain = replace(measured_only(run), time=time, position=position, torque=zero)
        along = logged_run(arm, plain, arm.parameters, 40.0)
        torque, v = along.predicted.copy(), along.dq[:, SHOULDER]
        torque[:, SHOULDER] += extra * np.exp(-((np.abs(v) / 0.12) ** 3)) * np.sign(v)
        noise = np.random.default_rng(index).normal(0, 0.02, torque.shape)
        runs[name] = replace(plain, torque=torque + noise)
    found = attribute(prepare(arm, runs))
    named = [(a.candidate.family.effect, a.candidate.family.joint) for a in found.accepted if a.named]
    assert named == [("stribeck_friction", SHOULDER)]
    assert not found.prepared.coulomb_smoothing.any()
