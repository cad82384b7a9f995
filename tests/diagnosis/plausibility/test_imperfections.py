"""What several joints of a robot show alike is how its joints are, and no one joint's effect."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

from diagnosis.decision.findings import Diagnosis
from diagnosis.diagnose import diagnose
from diagnosis.fit.likelihood import Weighed
from diagnosis.fit.score import Stage
from diagnosis.model.candidates import Candidate
from diagnosis.model.effect_sizes import times_healthy
from diagnosis.plausibility.accepted import Accepted
from diagnosis.plausibility.imperfections import of_one_joint
from diagnosis.report.words import everywhere
from testbench.effects import parse_injection
from testbench.robot import Robot, load_robot

from ...diagnosed import simulated_runs
from ...small_arm import SCARA, small_arm
from ..certain_gain import certain, healthy_stage, squares

# N·m·s²/rad² (N·s²/m²) that bend each joint's friction about as much, by its own torque.
BENT = {"turn": 1.2, "fold": 0.45, "lift": 90.0}


@pytest.fixture(scope="module")
def scara(tmp_path_factory: pytest.TempPathFactory) -> Robot:
    return small_arm(tmp_path_factory.mktemp("scara"), SCARA)


def _diagnosed(robot: Robot, text: str, values: Mapping[str, float]) -> Diagnosis:
    """Of a robot with this effect at some joints. values: by joint; none has it where that is zero."""
    faults = [parse_injection(robot, text.format(*each)) for each in values.items() if each[1] > 0]
    return diagnose(robot, simulated_runs(robot, faults, runs=3))


@pytest.mark.parametrize(("others", "named"), [(0.0, [1]), (0.4, [0, 1, 2]), (1.0, [])])
def test_friction_that_bends_hardly_more_than_at_other_joints_is_no_joints_effect(scara, others, named):
    # A joint that has far more is not among those that the others are held against.
    shares = {"turn": others, "fold": 1.0, "lift": others}
    bends = {joint: share * BENT[joint] for joint, share in shares.items()}
    found = _diagnosed(scara, "nonlinear_viscous_friction:{}:coefficient={},exponent=2", bends)
    assert sorted(each.joint for each in found.effects) == named
    assert bool(everywhere(found)) == (not named)
    assert {name for name, _ in found.everywhere} <= {"nonlinear_viscous_friction", "stribeck_friction"}
    if not named:
        assert found.verdict == "parameters"


@pytest.mark.parametrize(
    ("stiff", "named"),
    [
        ({"fold": 1000.0}, [1]),
        ({"fold": 1000.0, "turn": 1400.0}, [0, 1]),
        ({"fold": 1500.0, "turn": 5000.0}, [0, 1]),
        # Of these three the quill alone carries little beside friction.
        ({"fold": 1500.0, "turn": 4000.0, "lift": 6000.0}, [2]),
    ],
)
def test_bristles_have_a_name_unless_other_joints_have_some_and_more_else_is_carried(scara, stiff, named):
    # N·m/rad (N/m), of bristles that give way with all of the joint's Coulomb friction.
    found = _diagnosed(scara, "presliding_hysteresis:{}:stiffness={}", stiff)
    assert sorted(each.joint for each in found.effects) == named
    assert {each.effect for each in found.effects} <= {"presliding_hysteresis"}


def _is_of_one(
    robot: Robot,
    name: str,
    times: float,
    torque: float,
    others: tuple[str, float],
    of_torque: float = 1.0,
    fault: float = 0.0,
) -> bool:
    """Whether an effect of the first joint keeps its name beside others' imperfections.

    times: how many times a healthy joint's. others: an effect, and how many times. of_torque: theirs, as a
    multiple of its own. fault: how many times a healthy joint's another one has that keeps its name.
    """
    base, (own, *_) = healthy_stage(robot, name)
    _, elsewhere = healthy_stage(robot, others[0])

    def amount(candidate: Candidate, wanted: float) -> float:
        unit = times_healthy(robot, base.ground.torque_rms, candidate, np.eye(candidate.count)[0])
        # Bristles are the worse the softer they are.
        return unit / wanted if candidate.family.effect == "presliding_hysteresis" else wanted / unit

    taken_in = [(own, times), *([(elsewhere[1], fault)] if fault else [])]
    hypothesis, fitted = base.with_effects([each for each, _ in taken_in])
    values, covariance = fitted.values.copy(), fitted.covariance.copy()
    for part, (each, size) in zip(hypothesis.parts, taken_in, strict=True):
        values[part] = amount(each, size) * np.eye(each.count)[0]
        covariance[part, part] = amount(each, size) ** 2 / 400 * np.eye(each.count)
    last = Stage(base.ground, hypothesis, replace(fitted, values=values, covariance=covariance))
    theirs = squares(base, of_torque * torque)
    last.held_squares = 2 * theirs
    open_ = [
        Weighed(certain(base, each, amount(each, others[1]), theirs * np.eye(robot.joints)[joint]), 30.0)
        for joint, each in enumerate(elsewhere)
        if joint > 0
    ]
    worth = [torque**2, (10 * torque) ** 2]
    items = [
        Accepted(each, 1.0, (), score=300.0, share=0.9, worth=own_worth)
        for (each, _), own_worth in zip(taken_in, worth, strict=False)
    ]
    found, *faults = of_one_joint(robot, items, open_, last)
    assert all(each.named for each in faults)
    assert found.named != found.is_everywhere
    return found.named


@pytest.mark.parametrize(
    ("name", "times", "others", "named"),
    [
        ("stribeck_friction", 3.0, 0.5, True),
        ("stribeck_friction", 3.0, 2.5, False),
        ("stribeck_friction", 1.8, 0.5, False),
        # What grows with the load is told by its own size.
        ("load_dependent_friction", 2.0, 5.0, True),
        ("load_dependent_friction", 1.4, 0.5, False),
        # Each joint's friction bends a little.
        ("nonlinear_viscous_friction", 3.0, 0.7, True),
        ("nonlinear_viscous_friction", 3.0, 1.0, False),
        ("nonlinear_viscous_friction", 1.8, 0.1, False),
    ],
)
def test_friction_far_beyond_the_other_joints_is_one_joints(scara, name, times, others, named):
    assert _is_of_one(scara, name, times, 0.01, ("transmission_ripple", others)) == named


def test_what_another_joint_has_by_name_is_no_imperfection_that_friction_is_held_against(scara):
    assert _is_of_one(scara, "stribeck_friction", 3.0, 0.01, ("stribeck_friction", 0.5), fault=20.0)


@pytest.mark.parametrize(
    ("times", "others", "named"), [(3.0, 0.7, True), (3.0, 1.0, False), (1.6, 0.2, False)]
)
def test_a_cable_far_stiffer_than_the_other_joints_is_one_joints(scara, times, others, named):
    assert _is_of_one(scara, "cable_spring", times, 0.01, ("cable_spring", others), 0.5) == named


@pytest.mark.parametrize(
    ("name", "times", "of_torque", "named"),
    [
        # Every joint has a cable, and friction that grows with its load.
        ("cable_spring", 1.6, 0.3, True),
        ("cable_spring", 1.6, 0.4, False),
        ("load_dependent_friction", 1.2, 0.7, True),
        ("load_dependent_friction", 1.2, 0.9, False),
        # Near rest, others' larger imperfections are no less near.
        ("stribeck_friction", 3.0, 0.9, True),
        ("stribeck_friction", 3.0, 1.1, False),
        # But where it is far more.
        ("stribeck_friction", 5.0, 1.1, True),
    ],
)
def test_what_is_no_larger_a_part_of_the_torque_than_others_imperfections_is_no_one_joints(
    scara, name, times, of_torque, named
):
    assert _is_of_one(scara, name, times, 0.01, ("transmission_ripple", 0.5), of_torque) == named


@pytest.mark.parametrize(
    ("times", "others", "named"), [(0.9, 1.0, False), (0.9, 0.8, True), (1.1, 1.2, True)]
)
def test_what_other_joints_have_more_of_is_none_where_its_joint_carries_little(scara, times, others, named):
    """A healthy joint's friction may be much of the torque that its joint carries."""
    assert _is_of_one(scara, "stribeck_friction", times, 0.05, ("stribeck_friction", others), 0.3) == named


@pytest.mark.parametrize("torque", [0.01, 0.02])
@pytest.mark.parametrize(("others", "named"), [(1.5, False), (0.7, False), (0.5, True)])
def test_bristles_that_two_other_joints_have_too_are_no_one_joints(scara, torque, others, named):
    assert _is_of_one(scara, "presliding_hysteresis", 1.2, torque, ("presliding_hysteresis", others)) == named
    # But for those that are much of its torque.
    assert _is_of_one(scara, "presliding_hysteresis", 1.2, 0.03, ("presliding_hysteresis", others))


@pytest.mark.parametrize(("others", "named"), [(1.5, False), (0.4, True)])
def test_bristles_that_most_joints_have_are_no_one_joints_however_much_of_its_torque(models, others, named):
    robot = load_robot(models / "tx90.xml")
    assert _is_of_one(robot, "presliding_hysteresis", 1.2, 0.03, ("presliding_hysteresis", others)) == named


@pytest.mark.parametrize(("of_torque", "named"), [(0.2, True), (0.4, False)])
def test_soft_bristles_of_other_joints_that_hardly_press_on_them_take_no_name(scara, of_torque, named):
    others = ("presliding_hysteresis", 5.0)
    assert _is_of_one(scara, "presliding_hysteresis", 1.2, 0.01, others, of_torque) == named
