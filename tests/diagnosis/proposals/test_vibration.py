"""What shakes a joint at one frequency is not named a lag of its drive; a lag is."""

from types import SimpleNamespace

import numpy as np
import pytest

from diagnosis.diagnose import diagnose
from diagnosis.proposals.vibration import is_one_law, strongest_line
from testbench.effects import parse_injection
from testbench.effects.base import Injection

from ...diagnosed import simulated_runs
from ...small_arm import small_arm


@pytest.mark.parametrize(("frequency", "size"), [(8.0, 0.3), (8.0, 0.5), (12.0, 0.5)])
def test_a_joint_that_is_shaken_at_one_frequency_has_no_lag(tmp_path, frequency, size):
    shaken = Injection("vibration", 1, {"size": size, "frequency": frequency, "phase": 0.3})
    arm = small_arm(tmp_path)
    found = diagnose(arm, simulated_runs(arm, [shaken], runs=3))
    assert found.verdict == "unknown"
    assert not found.effects
    assert found.where[0].joint == 1
    # Nor has the corrected simulator.
    assert not found.final[0].joints_with("actuator_lag")
    assert f"follows a vibration at {frequency:.1f} Hz" in found.sentence


@pytest.mark.parametrize(
    ("line", "beside", "expected"),
    [(1.0, 0.8, True), (1.0, 0.4, False), (0.7, 0.9, False), (1.0, 0.0, False), (0.9, 1.1, True)],
)
def test_a_lag_keeps_its_size_on_a_line_and_off_it(line, beside, expected):
    deviations = np.array([0.05, 0.15, 0.05])
    parts = SimpleNamespace(coefficients=np.array([line, beside, 0.0]), information=np.diag(deviations**-2.0))
    assert is_one_law(parts) == expected


def test_what_shakes_a_joint_a_little_leaves_a_spring_its_name(tmp_path):
    shaken = Injection("vibration", 1, {"size": 0.3, "frequency": 8.0, "phase": 0.3})
    arm = small_arm(tmp_path)
    spring = parse_injection(arm, "cable_spring:elbow:stiffness=5,rest=0.2")
    found = diagnose(arm, simulated_runs(arm, [shaken, spring], runs=3))
    assert [(each.effect, each.joint) for each in found.effects] == [("cable_spring", 1)]


def test_a_lag_is_named_whatever_line_it_is_strongest_in(tmp_path):
    arm = small_arm(tmp_path)
    late = parse_injection(arm, "actuator_lag:shoulder:time_constant=0.012")
    found = diagnose(arm, simulated_runs(arm, [late], runs=3))
    assert [(each.effect, each.joint) for each in found.effects] == [("actuator_lag", 0)]


@pytest.mark.parametrize("samples", [8, 40, 400])
def test_the_strongest_line_is_found_of_runs_of_any_length(samples):
    rate = 40.0
    frequencies = np.fft.rfftfreq(samples, 1 / rate)
    power = np.where(np.abs(frequencies - 10.0) < 1e-9, 1.0, 0.0)
    assert strongest_line(frequencies, power) == pytest.approx(10.0, abs=0.5)
