"""Ripple and eccentricity are waves in the position: told with what they have beside their first harmonic."""

import pytest

from diagnosis.diagnose import diagnose
from testbench.effects import parse_injection

from .diagnosed import simulated_runs

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
def test_a_wave_is_told_with_its_law_and_nothing_of_it_is_left(arm, effect, law, values):
    injection = parse_injection(arm, f"{effect}:elbow:{values},law={law}")
    found = diagnose(arm, simulated_runs(arm, [injection], runs=3))
    (wave,) = found.effects
    assert (wave.effect, wave.joint, wave.law) == (effect, 1, law)
    parameters, effects, noise = found.gap.parameters[1], found.gap.effects[1], found.gap.noise_floor[1]
    assert parameters - effects > CLOSED * (parameters - noise)
    if law == "load_modulated":
        # Its full load is of the motion: at no load, and what a load adds.
        told = {name: quantity.value for name, quantity in wave.parameters.items()}
        unloaded = told["amplitude"] * told["unloaded"]
        per_load = (told["amplitude"] - unloaded) / told["full_load"]
        assert unloaded == pytest.approx(2.0 * 0.3, rel=0.1)
        assert per_load == pytest.approx(2.0 * 0.7 / 20, rel=0.1)
        return
    for name, wanted in injection.values.items():
        quantity = wave.parameters[name]
        assert abs(quantity.value - wanted) < 4 * quantity.std, name
