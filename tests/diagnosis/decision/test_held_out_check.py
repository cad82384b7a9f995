"""What no effect of the catalogue is, though one was fitted; and a little of one effect alone."""

import re
from dataclasses import replace

import numpy as np
import pytest

from diagnosis.data.preparation import prepare
from diagnosis.decision.findings import Gap
from diagnosis.decision.held_out_check import closed_without_a_name, names_that_hold, pushes_that_hold
from diagnosis.diagnose import diagnose
from diagnosis.model.candidates import candidates
from testbench.effects import parse_injection

from ...diagnosed import RATE, simulated_runs
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
def test_a_gap_that_effects_without_a_name_close_is_told_as_unknown(prepared, after, torque, named, expected):
    gap = Gap(*(np.array([1.0, each]) for each in (10.0, 10.0, after, 0.5)))
    item = accepted_of(candidates(prepared, only=["stribeck_friction"])[0], named=named)
    found = closed_without_a_name([item], gap, np.array([torque, torque]))
    assert [each.joint for each in found] == expected
    alike = replace(item, is_everywhere=True, candidate=candidates(prepared, only=["stribeck_friction"])[-1])
    assert alike.candidate.family.joint == 1
    assert not closed_without_a_name([alike], gap, np.array([torque, torque]))


@pytest.mark.parametrize(
    ("after", "elsewhere", "fitted", "floor", "torque", "holds", "unknown"),
    [
        (9.9, 1.0, 5.0, 1.0, 50.0, False, [1]),
        (5.0, 1.0, 5.0, 1.0, 50.0, True, []),
        # Each run tells something else.
        (9.9, 1.0, 2.0, 1.0, 50.0, True, []),
        (9.9, 1.0, 5.0, 4.0, 50.0, True, []),
        # Of all that the joints leave, this is next to nothing.
        (9.0, 9.9, 2.0, 1.0, 50.0, False, [1]),
        # All runs together leave hardly more than noise.
        (9.0, 9.9, 1.9, 1.0, 50.0, True, []),
        # And of the joint's torque this is.
        (9.9, 1.0, 5.0, 1.0, 1000.0, False, []),
    ],
)
def test_a_name_that_leaves_the_gap_as_it_was_does_not_hold(
    prepared, after, elsewhere, fitted, floor, torque, holds, unknown
):
    cable = next(c for c in candidates(prepared, only=["cable_spring"]) if c.family.joint == 1)
    stages = ((12.0, 12.0), (10.0, 10.0), (elsewhere, after), (1.0, floor))
    push = replace(cable, family=replace(cable.family, effect="external_contact"))
    item, left = accepted_of(cable), replace(accepted_of(push), share=0.0)
    gap, scale = Gap(*map(np.array, stages)), np.array([50.0, torque])
    found, unmet = names_that_hold([item, left], gap, np.array([1.0, fitted]), scale)
    # A push of that joint would be what it leaves.
    assert [each.named for each in found] == [holds, holds]
    assert [each.joint for each in unmet] == unknown
    assert all(each.nearest == "cable_spring" for each in unmet)


@pytest.mark.parametrize(
    ("after", "fitted", "floor", "torque", "pushed", "holds"),
    [
        (5.0, 5.0, 0.9, 50.0, False, False),
        # All runs together fit it.
        (5.0, 2.0, 0.9, 50.0, False, True),
        # Little is left, by the noise, by the gap, by the torque.
        (4.0, 4.0, 0.9, 50.0, False, True),
        (2.0, 2.0, 0.3, 50.0, False, True),
        (5.0, 5.0, 0.9, 1000.0, False, True),
        # It may be what a push leaves.
        (5.0, 5.0, 0.9, 50.0, True, True),
    ],
)
def test_a_name_that_leaves_its_joint_far_from_noise_does_not_hold(
    prepared, after, fitted, floor, torque, pushed, holds
):
    cable = next(c for c in candidates(prepared, only=["cable_spring"]) if c.family.joint == 1)
    push = replace(cable, family=replace(cable.family, effect="external_contact", joint=0))
    gap = Gap(*map(np.array, ((12.0, 12.0), (10.0, 10.0), (1.0, after), (1.0, floor))))
    accepted = [accepted_of(cable), replace(accepted_of(push), named=pushed, share=0.0)]
    found, unmet = names_that_hold(accepted, gap, np.array([1.0, fitted]), np.array([50.0, torque]))
    assert found[0].named == holds
    assert [each.nearest for each in unmet] == ([] if holds else ["cable_spring"])
    # Gearboxes that stiffen otherwise leave much.
    soft = replace(accepted[0], candidate=replace(cable, family=replace(cable.family, effect="backlash")))
    assert names_that_hold([soft], gap, np.array([1.0, fitted]), np.array([50.0, torque]))[0][0].named


@pytest.mark.parametrize(
    ("cycles", "share", "holds"), [(27.0, 0.93, True), (27.0, 0.85, False), (5.0, 0.93, False)]
)
def test_teeth_may_leave_the_harmonics_that_they_have_beyond_two(prepared, cycles, share, holds):
    ripple = next(c for c in candidates(prepared, only=["transmission_ripple"]) if c.family.joint == 1)
    teeth = replace(ripple, member=replace(ripple.member, shape={"cycles": cycles}))
    gap = Gap(*map(np.array, ((12.0, 12.0), (10.0, 10.0), (1.0, 5.0), (1.0, 0.9))))
    accepted = [replace(accepted_of(teeth), share=share)]
    found, _ = names_that_hold(accepted, gap, np.array([1.0, 5.0]), np.array([50.0, 50.0]))
    assert found[0].named == holds


@pytest.mark.parametrize(("share", "holds"), [(0.93, True), (0.85, False)])
def test_a_limit_may_leave_how_it_falls_with_speed(prepared, share, holds):
    other = next(c for c in candidates(prepared, only=["cable_spring"]) if c.family.joint == 1)
    limit = replace(other, family=replace(other.family, effect="torque_saturation"))
    gap = Gap(*map(np.array, ((12.0, 12.0), (10.0, 10.0), (1.0, 5.0), (1.0, 0.9))))
    accepted = [replace(accepted_of(limit), share=share)]
    found, _ = names_that_hold(accepted, gap, np.array([1.0, 5.0]), np.array([50.0, 50.0]))
    assert found[0].named == holds


def test_what_comes_nearest_is_told_with_what_it_leaves(arm, monkeypatch):
    runs = simulated_runs(arm, [parse_injection(arm, "cable_spring:elbow:stiffness=4.0,rest=0.4")], runs=3)
    assert [each.effect for each in diagnose(arm, runs).effects] == ["cable_spring"]
    # As if it left more than a robot's own law does.
    monkeypatch.setattr("diagnosis.decision.held_out_check.LEFT_FAR_FROM_NOISE", 0.0)
    monkeypatch.setattr("diagnosis.decision.held_out_check.MOSTLY_CLOSED", 2.0)
    monkeypatch.setattr("diagnosis.decision.held_out_check.FAR_FROM_NOISE", 0.0)
    monkeypatch.setattr("diagnosis.decision.held_out_check.LEAST_UNMET", 0.0)
    found = diagnose(arm, runs)
    assert found.verdict == "unknown"
    assert re.match(r"At elbow cable spring comes nearest and leaves \d+% of the gap: ", found.sentence)
    (reason,) = [each.reason for each in found.ranked if (each.effect, each.joint) == ("cable_spring", 1)]
    assert reason == "fitted, but leaves too much of the gap"


@pytest.mark.parametrize(
    ("after", "elsewhere", "beside", "holds"),
    [
        (6.0, 0.0, False, False),
        (3.0, 0.0, False, True),
        (6.0, 0.0, True, True),
        # All of its joint's is a push, whatever is left elsewhere.
        (1.5, 30.0, False, True),
    ],
)
def test_a_push_that_leaves_half_of_the_gap_is_none(prepared, after, elsewhere, beside, holds):
    cable = next(c for c in candidates(prepared, only=["cable_spring"]) if c.family.joint == 1)
    push = accepted_of(replace(cable, family=replace(cable.family, effect="external_contact")))
    gap = Gap(*(np.array([0.9 * elsewhere * (each > 1), each]) for each in (12.0, 10.0, after, 1.0)))
    found, bursts = pushes_that_hold([push, replace(accepted_of(cable), named=beside)], gap)
    assert found[0].named == holds
    assert [each.joint for each in bursts] == ([] if holds else [1])


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
