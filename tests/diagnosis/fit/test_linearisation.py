"""Where effects are linearised: at the size of a delay, with a payload as part of the load."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis.data.preparation import prepare
from diagnosis.fit.delay import likeliest_delay
from diagnosis.fit.linearisation import first_linearised, linearised_anew
from diagnosis.fit.normal_equations import fit, fitted_to, squares
from diagnosis.model.base_regressor import BaseRegressor
from diagnosis.model.candidates import candidates
from testbench.effects import parse_injection

from ...diagnosed import simulated_runs

LAST = 1


def _runs(arm, text):
    return simulated_runs(arm, [parse_injection(arm, text)], runs=3, seed=3)


@pytest.mark.parametrize("delay", [0.008, 0.016, 0.04])
def test_a_delay_is_found_whether_or_not_the_controller_shakes(arm, delay):
    prepared = prepare(arm, _runs(arm, f"torque_delay::delay={delay}"))
    found, _ = likeliest_delay(*fitted_to(BaseRegressor(prepared), []))
    # A fifth of a sample: position and torque are sampled that much apart already.
    assert found == pytest.approx(delay, abs=0.2 / prepared.runs[0].logged.sample_rate)


def test_beside_a_delay_the_log_is_not_late_as_well(arm):
    """However little noise there is, and however far the delay that is tried is from the robot's."""
    prepared = prepare(arm, _runs(arm, "torque_delay::delay=0.03"))
    hypothesis, fitted = fitted_to(BaseRegressor(prepared), candidates(prepared, only=["torque_delay"])[:1])
    sure = fit(hypothesis, like=replace(fitted, weights=1e4 * fitted.weights))
    assert abs(sure.values[hypothesis.parameters - 1]) < 1e-6


@pytest.mark.parametrize("delay", [0.008, 0.016, 0.025])
def test_the_column_of_a_delay_is_settled_at_its_own_size(arm, delay):
    prepared = first_linearised(prepare(arm, _runs(arm, f"torque_delay::delay={delay}")))
    nearest = min(
        candidates(prepared, only=["torque_delay"]),
        key=lambda each: abs(each.member.shape["difference"] - delay),
    )
    hypothesis, fitted = linearised_anew(*fitted_to(BaseRegressor(prepared), [nearest]))
    assert fitted.values[-1] == pytest.approx(hypothesis.accepted[0].member.shape["difference"], rel=0.02)
    assert fitted.values[-1] == pytest.approx(delay, rel=0.02)


def test_a_payload_loads_the_gearboxes(arm):
    text = "payload::mass=0.6,first_moment_x=0.06,first_moment_y=0,first_moment_z=0"
    prepared = first_linearised(prepare(arm, _runs(arm, text)))
    hypothesis, fitted = linearised_anew(
        *fitted_to(BaseRegressor(prepared), candidates(prepared, only=["payload"]))
    )
    mass = fitted.values[hypothesis.parts[0]][9]
    assert mass > 0.2
    # What the model says of the torque has the payload, whichever share of it the link itself has taken up.
    for run in hypothesis.prepared.runs:
        assert np.std(run.logged.residual[:, 0]) < 0.1 * np.std(run.logged.tau[:, 0])
    by_hand = hypothesis.prepared.nominal + fitted.values[: len(hypothesis.prepared.nominal)]
    assert hypothesis.prepared.runs[0].logged.table[LAST, 9] > by_hand.reshape(arm.joints, -1)[LAST, 9] + 0.1


def test_the_gearboxes_carry_a_spring(arm):
    prepared = first_linearised(prepare(arm, _runs(arm, "gravity_spring:elbow:stiffness=5,phase=0.4")))
    sine = next(c for c in candidates(prepared, only=["gravity_spring"]) if c.family.joint == LAST)
    hypothesis, fitted = linearised_anew(*fitted_to(BaseRegressor(prepared), [sine]))
    stiffness = np.hypot(*fitted.values[hypothesis.parts[0]])
    for run in hypothesis.prepared.runs:
        logged = run.logged
        assert np.std(logged.residual[:, LAST]) < 0.1 * np.std(logged.tau[:, LAST])
        spring = logged.load - replace(logged, carried=None).load
        assert np.ptp(spring[:, LAST]) == pytest.approx(
            stiffness * np.ptp(np.sin(0.4 - logged.q[:, LAST])), rel=0.1
        )


def test_a_gap_shows_once_a_tilted_base_is_part_of_what_the_gearbox_carries(arm):
    injections = ("backlash:elbow:gap=0.003", "base_tilt::roll=0.06,pitch=0.04")
    runs = simulated_runs(arm, [parse_injection(arm, text) for text in injections], runs=3, seed=3)
    prepared = first_linearised(prepare(arm, runs))
    tilt = candidates(prepared, only=["base_tilt"])[0]
    gap = next(
        each
        for each in candidates(prepared, only=["backlash"])
        if (each.family.joint, each.member.shape["gap"]) == (LAST, 0.003)
    )
    hypothesis, before = fitted_to(BaseRegressor(prepared), [gap, tilt])
    after = linearised_anew(hypothesis, before)[1]
    assert before.values[hypothesis.parts[0]] == pytest.approx(0, abs=0.1)
    assert after.values[hypothesis.parts[0]] == pytest.approx(1, abs=0.3)
    assert squares(after.held_out)[LAST] < 0.5 * squares(before.held_out)[LAST]


def test_what_is_known_is_not_looked_for_again(arm):
    prepared = first_linearised(prepare(arm, _runs(arm, "transmission_ripple:elbow:amplitude=0.8,cycles=12")))
    ripple = max(
        candidates(prepared, only=["transmission_ripple"]),
        key=lambda each: np.max(np.abs(fitted_to(BaseRegressor(prepared), [each])[1].values[-2:])),
    )
    hypothesis, _ = linearised_anew(*fitted_to(BaseRegressor(prepared), [ripple]))
    before, after = (np.std(p.runs[0].logged.residual[:, LAST]) for p in (prepared, hypothesis.prepared))
    assert after < 0.6 * before
