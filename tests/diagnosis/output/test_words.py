"""Numbers and times as the page and the terminal spell them."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest
from scipy.signal import butter, sosfiltfilt

from diagnosis.report.notes import noise_unseen
from diagnosis.report.words import parameters, quantity
from testbench.effects.signature import Quantity

from ...diagnosed import diagnosed


@pytest.mark.parametrize(
    ("value", "deviation", "expected"),
    [
        (3.6912, 0.12, "3.69 ± 0.12 N·m"),
        (25360.7, 81.2, "25361 ± 81 N·m"),
        (0.153, 0.064, "0.153 ± 0.064 N·m"),
        (0.0, 0.1, "0 ± 0.1 N·m"),
        (0.12345, 0.0, "0.123 N·m"),
    ],
)
def test_a_number_is_found_as_far_as_it_is_known(value, deviation, expected):
    assert quantity(Quantity(value, deviation, "N·m")) == expected


def test_when_a_push_was_is_found_by_the_clock_of_the_logs():
    times = Quantity((310.6508, 311.1268, 1546.8304, 1547.2664), (0.101,) * 4, "s")
    named: Any = SimpleNamespace(
        candidate=SimpleNamespace(member=SimpleNamespace(law=None)),
        parameters={"intervals": times},
        runs=(0, 2),
    )
    text = parameters(named, ("calm", "quiet", "pushed"))
    assert text == "intervals 310.7 to 311.1 in calm; 1546.8 to 1547.3 in pushed, s (each ± 0.1)"


def test_a_floor_of_low_passed_logs_is_found_as_a_bound(robot, runs, answer):
    low_passed = {
        name: replace(
            run, torque=sosfiltfilt(butter(5, 15.0, output="sos", fs=run.sample_rate), run.torque, axis=0)
        )
        for name, run in runs.items()
    }
    assert not noise_unseen(answer)
    assert "all joints was low-passed" in noise_unseen(diagnosed(robot, low_passed, []))[0]
