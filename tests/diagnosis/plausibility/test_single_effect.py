"""What is small has a name where nothing else is seen at any joint: robots are imperfect everywhere."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis.diagnose import diagnose
from diagnosis.fit.likelihood import Weighed, gained
from diagnosis.model.candidates import candidates
from diagnosis.model.effect_sizes import times_healthy
from diagnosis.plausibility.accepted import Accepted
from diagnosis.plausibility.single_effect import is_elsewhere, is_enough_alone, is_most
from testbench.effects import parse_injection
from tests.diagnosed import simulated_runs
from tests.diagnosis.certain_gain import certain, healthy_stage, squares
from tests.small_arm import small_arm

FAULT = "transmission_ripple:shoulder:amplitude=1.5,cycles=12"
IMPERFECTION = "transmission_ripple:shoulder:amplitude=0.15,cycles=12"


@pytest.mark.parametrize(
    ("effects", "named"),
    [
        # Of what may be any cable, six and two tenths.
        (["gravity_spring:elbow:stiffness=0.06,phase=0.5"], ["gravity_spring"]),
        (["gravity_spring:elbow:stiffness=0.02,phase=0.5"], []),
        (["gravity_spring:elbow:stiffness=0.06,phase=0.5", IMPERFECTION], []),
        # Of what pulls at any arm, eight and five tenths.
        (["cable_spring:elbow:stiffness=0.05,rest=0.2"], ["cable_spring"]),
        (["cable_spring:elbow:stiffness=0.03,rest=0.2"], []),
        # Beside what has a name at another joint, that is nothing else.
        ([FAULT, "gravity_spring:elbow:stiffness=0.06,phase=0.5"], ["transmission_ripple", "gravity_spring"]),
        ([FAULT, "gravity_spring:elbow:stiffness=0.02,phase=0.5"], ["transmission_ripple"]),
        # Logs of 1 kHz may be taken a millisecond apart.
        (["torque_delay::delay=0.0015"], ["torque_delay"]),
        (["torque_delay::delay=0.0008"], []),
        (["torque_delay::delay=0.0015", IMPERFECTION], []),
        ([FAULT, "torque_delay::delay=0.0015"], ["transmission_ripple", "torque_delay"]),
    ],
)
def test_a_small_effect_has_a_name_where_nothing_else_is_seen(tmp_path, effects, named):
    arm = small_arm(tmp_path)
    runs = simulated_runs(arm, [parse_injection(arm, text) for text in effects], runs=3)
    assert [each.effect for each in diagnose(arm, runs).effects] == named


@pytest.mark.parametrize(
    ("joints", "of", "wald", "expected"),
    [
        ((1, 2), 6, 30.0, True),
        ((1, 2, 3), 6, 30.0, False),
        ((1, 2, 3), 6, 20.0, True),
        ((1,), 3, 30.0, True),
        ((1, 2), 3, 30.0, False),
    ],
)
def test_nothing_is_alone_where_most_joints_have_a_little_of_something(tmp_path, joints, of, wald, expected):
    stage, (own, _) = healthy_stage(small_arm(tmp_path), "transmission_ripple")
    own, squared = replace(own, joints=of), squares(stage, 0.01)
    best = Weighed(certain(stage, own, 1.0, squared), 600.0)
    rest = []
    for joint in joints:
        there = replace(own, family=replace(own.family, joint=joint))
        rest.append(Weighed(replace(certain(stage, own, 1.0, squared, wald), candidate=there), 100.0))
    assert is_most(best, rest) == expected


@pytest.mark.parametrize(("joint", "expected"), [(0, True), (1, False)])
def test_what_is_of_the_whole_robot_is_elsewhere_where_it_gains_its_most(tmp_path, joint, expected):
    """Beside what has a name at the elbow."""
    stage, (_, elbow) = healthy_stage(small_arm(tmp_path), "actuator_lag")
    (tilt,) = candidates(stage.prepared, only=["base_tilt"])
    gain = certain(stage, tilt, 0.01, squares(stage, 0.001) * np.eye(2)[joint])
    named = Accepted(elbow, probability=1.0, rivals=(), score=90.0, share=0.9, worth=0.01)
    assert is_elsewhere(stage, Weighed(gain, gained(stage, gain)), [named]) == expected


@pytest.mark.parametrize(
    ("times", "share", "expected"),
    [(0.65, 0.2, True), (0.45, 0.5, True), (0.45, 0.2, False), (0.25, 0.5, False)],
)
def test_a_small_gravity_spring_alone_is_much_of_what_is_left(tmp_path, times, share, expected):
    stage, (_, elbow) = healthy_stage(small_arm(tmp_path), "gravity_spring")
    robot, torque = stage.prepared.robot, stage.ground.torque_rms
    amount = times / times_healthy(robot, torque, elbow, np.eye(elbow.count)[0])
    gain = certain(stage, elbow, amount, share * stage.held_squares)
    best = Weighed(gain, 60.0)
    assert is_enough_alone(robot, stage, best, gain.coefficients) == expected


@pytest.mark.parametrize(
    ("effect", "least"),
    [("torque_gain_error", 0.5), ("asymmetric_friction", 0.45), ("thermal_friction_drift", 0.7)],
)
def test_a_part_of_a_healthy_size_is_enough_alone(tmp_path, effect, least):
    stage, (_, elbow) = healthy_stage(small_arm(tmp_path), effect)
    robot, torque = stage.prepared.robot, stage.ground.torque_rms
    one = 100 * times_healthy(robot, torque, elbow, 0.01 * np.eye(elbow.count)[0])
    for times in (0.9 * least, 1.1 * least):
        gain = certain(stage, elbow, times / one, 0.2 * stage.held_squares)
        assert is_enough_alone(robot, stage, Weighed(gain, 60.0), gain.coefficients) == (times > least)
