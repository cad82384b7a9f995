"""What is worth a name at a joint that has an effect already, and what every arm has."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis.fit.likelihood import Weighed
from diagnosis.fit.score import Stage
from diagnosis.model.candidates import candidates
from diagnosis.plausibility.prominence import is_main

from ...small_arm import small_arm
from ..certain_gain import healthy_stage, of_size, squares


@pytest.mark.parametrize(
    ("torque", "left", "expected"), [(0.03, 0.6, True), (0.01, 0.6, False), (0.03, 0.4, False)]
)
def test_a_second_effect_of_a_joint_is_told_from_the_firsts_rest_by_its_torque_and_share(
    tmp_path, torque, left, expected
):
    arm = small_arm(tmp_path)
    stage, (own, _) = healthy_stage(arm, "transmission_ripple")
    (named,) = candidates(stage.prepared, only=["stribeck_friction"])[:1]
    assert _is_named(arm, stage, of_size(arm, stage, own, 3.0, torque, left), [named]) == expected


def _is_named(arm, stage, gain, firsts, before=100.0):
    """Beside as much at another joint. before: what re-identification left, in what is left now."""
    first = Stage.of(stage.ground, [])
    first.held_squares = before * stage.held_squares
    friction = candidates(stage.prepared, only=["stribeck_friction"])
    other = next(c for c in friction if c.family.joint != gain.candidate.family.joint)
    rest = [Weighed(replace(gain, candidate=other), 30.0)]
    return is_main(arm, first, stage, Weighed(gain, 30.0), firsts, rest)


def test_a_coupling_leaves_a_rest_at_both_of_its_joints(tmp_path):
    arm = small_arm(tmp_path)
    stage, (_, own) = healthy_stage(arm, "asymmetric_friction")
    gain = of_size(arm, stage, own, 2.0, 0.0025, 0.34)
    coupling = candidates(stage.prepared, only=["joint_coupling"])[0]
    assert (coupling.family.joint, coupling.family.into) == (0, 1)
    assert not _is_named(arm, stage, gain, [coupling])
    assert _is_named(arm, stage, gain, [], before=1.0)


@pytest.mark.parametrize(("times", "expected"), [(2.0, True), (1.3, False)])
def test_an_eccentric_encoder_is_no_rest_of_a_coupling(tmp_path, times, expected):
    arm = small_arm(tmp_path)
    stage, (_, own) = healthy_stage(arm, "encoder_eccentricity")
    coupling = candidates(stage.prepared, only=["joint_coupling"])[0]
    gain = of_size(arm, stage, own, times, 0.004, 0.25)
    assert _is_named(arm, stage, gain, [coupling]) == expected


@pytest.mark.parametrize(
    ("first", "expected"), [("load_dependent_friction", True), ("joint_elasticity", False)]
)
def test_what_a_second_effect_does_to_joints_that_the_first_leaves_alone_is_no_rest(
    tmp_path, first, expected
):
    arm = small_arm(tmp_path)
    stage, (own, _) = healthy_stage(arm, "encoder_offset")
    (named,) = [c for c in candidates(stage.prepared, only=[first]) if c.family.joint == 0][:1]
    assert (1 in named.member.rows) != expected
    gain = of_size(arm, stage, own, 2.0, 0.0005, 0.02)
    at_the_other = gain.held_out[0] * np.array([1.0, 0.0])
    at_the_other[1] = squares(stage, 0.03)[1]
    stage.held_squares[1] = at_the_other[1] / 0.8
    assert _is_named(arm, stage, replace(gain, held_out=at_the_other), [named]) == expected


@pytest.mark.parametrize(
    ("first", "left", "expected"),
    [("backlash", 0.35, False), ("transmission_ripple", 0.35, True), ("backlash", 0.7, True)],
)
def test_an_elasticity_beside_a_play_of_its_joint_is_most_of_what_that_leaves(
    tmp_path, first, left, expected
):
    arm = small_arm(tmp_path)
    stage, (own, _) = healthy_stage(arm, "joint_elasticity")
    named = next(c for c in candidates(stage.prepared, only=[first]) if c.family.joint == 0)
    gain = of_size(arm, stage, own, 2.0, 0.03, left)
    assert _is_named(arm, stage, gain, [named], before=1.0) == expected


@pytest.mark.parametrize(
    ("times", "torque", "left", "shift", "expected"),
    [
        (2.0, 0.02, 0.25, 0.0, True),
        (1.3, 0.02, 0.25, 0.0, False),
        (1.3, 0.02, 0.9, 0.0, True),
        # Of little torque, what the parameters swallow of it must tell.
        (2.0, 0.01, 0.9, 0.0, False),
        (2.0, 0.01, 0.9, 8.0, True),
    ],
)
def test_a_cable_that_is_little_of_the_rest_or_of_the_torque_is_beyond_what_every_arm_has(
    tmp_path, times, torque, left, shift, expected
):
    arm = small_arm(tmp_path)
    stage, (own, _) = healthy_stage(arm, "cable_spring")
    gain = of_size(arm, stage, own, times, torque, left)
    gain = replace(gain, overlap=0.99, prior=stage.prior + shift)
    assert _is_named(arm, stage, gain, [], before=1.0) == expected


@pytest.mark.parametrize(
    ("first", "times", "expected"),
    [
        ("presliding_hysteresis", 2.0, True),
        ("presliding_hysteresis", 0.7, False),
        # Its rest goes with the load, and so does most of the torque.
        ("load_dependent_friction", 2.0, False),
    ],
)
def test_a_gain_error_is_no_rest_of_friction_that_does_not_follow_the_load(tmp_path, first, times, expected):
    arm = small_arm(tmp_path)
    stage, (own, _) = healthy_stage(arm, "torque_gain_error")
    named = next(c for c in candidates(stage.prepared, only=[first]) if c.family.joint == 0)
    gain = of_size(arm, stage, own, times, 0.002, 0.05)
    assert _is_named(arm, stage, gain, [named]) == expected


@pytest.mark.parametrize(
    ("name", "expected"),
    [("cable_spring", True), ("transmission_ripple", True), ("stribeck_friction", False)],
)
def test_a_coupling_leaves_no_law_of_position_at_its_other_joint(tmp_path, name, expected):
    arm = small_arm(tmp_path)
    stage, (_, own) = healthy_stage(arm, name)
    gain = of_size(arm, stage, own, 4.0, 0.021, 0.52)
    coupling = candidates(stage.prepared, only=["joint_coupling"])[0]
    assert _is_named(arm, stage, gain, [coupling]) == expected
