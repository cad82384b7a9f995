"""What no effect of the catalogue is, though one was fitted; and a little of one effect alone."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis.data.preparation import prepare
from diagnosis.decision.held_out_check import closed_without_a_name
from diagnosis.diagnose import diagnose
from diagnosis.model.candidates import candidates
from testbench.effects import parse_injection

from ...diagnosed import RATE, exact_gap, simulated_runs
from ...small_arm import SCARA, small_arm
from ..accepted_effects import accepted_of


@pytest.fixture(scope="module")
def prepared(arm):
    return prepare(arm, simulated_runs(arm, [], runs=1))


@pytest.mark.parametrize(
    ("after", "torque", "named", "expected"),
    [
        (1.0, 50.0, False, [1]),
        (1.0, 50.0, True, []),
        # Imperfections of a healthy joint take off this much of its gap, but less of its torque.
        (1.0, 150.0, False, []),
        (8.0, 50.0, False, []),
    ],
)
def test_a_gap_that_effects_without_a_name_close_is_found_as_unknown(
    prepared, after, torque, named, expected
):
    gap = exact_gap(*(np.array([1.0, each]) for each in (10.0, 10.0, after, 0.5)))
    item = accepted_of(candidates(prepared, only=["stribeck_friction"])[0], named=named)
    found = closed_without_a_name([item], gap, np.array([torque, torque]))
    assert [each.joint for each in found] == expected
    alike = replace(item, is_everywhere=True, candidate=candidates(prepared, only=["stribeck_friction"])[-1])
    assert alike.candidate.family.joint == 1
    assert not closed_without_a_name([alike], gap, np.array([torque, torque]))


@pytest.mark.parametrize(("shaken", "verdict"), [((0,), "effect"), ((0, 1), "unknown")])
def test_a_name_where_half_the_joints_follow_nothing_is_a_trace_of_that(tmp_path, shaken, verdict):
    scara = small_arm(tmp_path, SCARA)
    runs = simulated_runs(scara, [parse_injection(scara, "cable_spring:lift:stiffness=150,rest=-0.1")])
    for name, run in runs.items():
        torque = run.torque.copy()
        for joint in shaken:
            size = 0.12 * torque[:, joint].std()
            torque[:, joint] += size * np.sin(2 * np.pi * (3.7 + 0.6 * joint) * run.time)
        runs[name] = replace(run, torque=torque)
    found = diagnose(scara, runs)
    assert found.verdict == verdict
    assert [(each.effect, each.joint) for each in found.effects] == (
        [("cable_spring", 2)] if verdict == "effect" else []
    )


@pytest.mark.parametrize(("band", "verdict"), [((9.0, 14.0), "unknown"), ((0.0, 500.0), "none")])
def test_what_is_far_louder_than_the_noise_is_unknown_however_fast(arm, band, verdict):
    """As much torque that nothing explains, within the band of the gap alone or in all of the log's."""
    rng, runs = np.random.default_rng(4), simulated_runs(arm, [])
    for name, run in runs.items():
        spectrum = np.fft.rfft(rng.normal(size=len(run.time)))
        frequency = np.fft.rfftfreq(len(run.time), 1 / RATE)
        spectrum[(frequency < band[0]) | (frequency > band[1])] = 0.0
        torque, loud = run.torque.copy(), np.fft.irfft(spectrum, len(run.time))
        passed = np.sqrt(min(20.0 / band[1], 1.0))
        torque[:, 1] += 0.05 * torque[:, 1].std() * loud / loud.std() / passed
        runs[name] = replace(run, torque=torque, torque_command=None)
    assert diagnose(arm, runs).verdict == verdict
