"""Ripple and eccentricity: waves in the position, named with what they have beside their first harmonic."""

import numpy as np
import pytest

from diagnosis.data.preparation import prepare
from diagnosis.diagnose import diagnose
from diagnosis.fit.linearisation import first_linearised
from diagnosis.fit.score import Stage
from diagnosis.model.base_regressor import BaseRegressor
from diagnosis.model.candidates import candidates
from diagnosis.proposals.ripple_peaks import ripple_candidates
from testbench.effects import parse_injection
from testbench.effects.transmission_ripple import SLOWEST

from ...diagnosed import simulated_runs

RIPPLE, ECCENTRICITY = "transmission_ripple", "encoder_eccentricity"
SINE = "amplitude=2.0,cycles=24.3,phase=0.5"
ONCE = "amplitude=0.03,phase=0.8"
WAVES = [
    (RIPPLE, "harmonic", SINE),
    (RIPPLE, "two_waves", f"{SINE},second_amplitude=0.5,second_cycles=48.6,second_phase=-1.2"),
    (RIPPLE, "two_waves", f"{SINE},second_amplitude=0.5,second_cycles=31.7,second_phase=-1.2"),
    (RIPPLE, "load_modulated", f"{SINE},unloaded=0.3,full_load=20"),
    (ECCENTRICITY, "once_per_turn", ONCE),
    (ECCENTRICITY, "two_harmonics", f"{ONCE},second_amplitude=0.008,second_phase=2.0"),
]
# Of what parameters leave above the noise at the elbow; without a second harmonic a wave closes .92 at most.
CLOSED = 0.95


@pytest.mark.parametrize(("effect", "law", "values"), WAVES)
def test_a_wave_is_found_with_its_law_and_nothing_of_it_is_left(arm, effect, law, values):
    injection = parse_injection(arm, f"{effect}:elbow:{values},law={law}")
    found = diagnose(arm, simulated_runs(arm, [injection], runs=3))
    (wave,) = found.effects
    assert (wave.effect, wave.joint, wave.law) == (effect, 1, law)
    parameters, effects, noise = found.gap.parameters[1], found.gap.effects[1], found.gap.noise_floor[1]
    assert parameters - effects > CLOSED * (parameters - noise)
    if law == "load_modulated":
        # Its full load is of the motion: at no load, and what a load adds.
        sizes = {name: quantity.value for name, quantity in wave.parameters.items()}
        unloaded = sizes["amplitude"] * sizes["unloaded"]
        per_load = (sizes["amplitude"] - unloaded) / sizes["full_load"]
        assert unloaded == pytest.approx(2.0 * 0.3, rel=0.1)
        assert per_load == pytest.approx(2.0 * 0.7 / 20, rel=0.1)
        return
    for name, wanted in injection.values.items():
        quantity = wave.parameters[name]
        assert abs(quantity.value - wanted) < 4 * quantity.std, name


@pytest.mark.parametrize("seed", [3, 4, 5, 6])
def test_two_waves_are_found_to_what_noise_allows_on_any_motion(arm, seed):
    """A search alone ends many deviations off: a step of Gauss and Newton's is its last."""
    injection = parse_injection(arm, f"{RIPPLE}:elbow:{WAVES[1][2]},law=two_waves")
    (wave,) = diagnose(arm, simulated_runs(arm, [injection], runs=3, seed=seed)).effects
    assert wave.law == "two_waves"
    for name in ("cycles", "second_cycles"):
        quantity = wave.parameters[name]
        assert abs(quantity.value - injection.values[name]) < 4 * quantity.std


@pytest.mark.parametrize("second", [24.0, 24.3, 24.5])
def test_two_waves_are_no_nearer_than_the_motion_tells_apart(arm, second):
    """Nearer ones cancel: of next to nothing any amplitude would come out."""
    prepared = prepare(arm, simulated_runs(arm, [], runs=1))
    ripple = next(each for each in candidates(prepared, only=[RIPPLE]) if each.family.joint == 1)
    assert ripple.family.member is not None
    waves = ripple.family.member({"cycles": 24.3, "second_cycles": second})
    turned = np.ptp(prepared.runs[0].logged.q[:, 1])
    # A whole turn of the phase between them, to the spacing of the periodogram.
    apart = turned * abs(waves.shape["second_cycles"] - waves.shape["cycles"])
    assert apart == pytest.approx(2 * np.pi, rel=0.1)
    # cos 2 pi x is orthogonal to one of another whole number of turns but for where the motion dwells.
    assert np.linalg.cond(waves.columns[0][:, 0]) < 10


def test_ripples_are_picked_anew_once_a_far_larger_effect_is_known(arm):
    cycles = 31.7
    lag = parse_injection(arm, "actuator_lag:elbow:time_constant=0.04")
    small = parse_injection(arm, f"{RIPPLE}:elbow:amplitude=0.05,cycles={cycles},phase=0.5")
    prepared = first_linearised(prepare(arm, simulated_runs(arm, [lag, small], runs=3)))
    catalogue = [each for each in candidates(prepared, only=[RIPPLE]) if each.family.joint == 1]
    lags = [each for each in candidates(prepared, only=["actuator_lag"]) if each.family.joint == 1]
    first = Stage.of(BaseRegressor(prepared), [])
    best = max(filter(None, map(first.gain, lags)), key=lambda gain: gain.objective)
    beside = Stage.of(first.base, [best.candidate])
    anew = [
        each
        for each in ripple_candidates(first.fitted, beside.hypothesis, beside.fitted)
        if each.family.joint == 1
    ]
    before, after = (
        min(abs(each.member.shape["cycles"] - cycles) for each in of) for of in (catalogue, anew)
    )
    assert before > 1.0
    assert after < 0.25
    assert min(each.member.shape["cycles"] for each in anew) > SLOWEST
    assert ripple_candidates(first.fitted, first.hypothesis, first.fitted) == []
