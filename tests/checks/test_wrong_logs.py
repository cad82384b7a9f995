"""A dozen of the mistakes that people make, at the servo arm; the study has all, at three robots."""

import pytest

from recordings.checks import run_checks
from studies.wrong_logs import MISTAKES, SERVO_ARM, Mistake, Plant, judge, plant

DOZEN = (
    "zero of joint 3 off by 90°, torque of joint 2 backwards",
    "joint 3 turns the other way from 90°",
    "joints 2 and 3 under each other's names",
    "torques of joints 2, 3, 4 passed round",
    "motor side of joints 2 to 4, ×4",
    "unsigned torque",
    "velocity in place of torque",
    "torque after gravity compensation",
    "torque in coarse steps",
    "torque 0 at rest",
    "held by a slower bus, stamps that jitter",
    "joint 1 stood still",
)


@pytest.fixture(scope="module")
def servo(tmp_path_factory) -> Plant:
    folder = tmp_path_factory.mktemp("servo")
    (folder / "servo_arm.xml").write_text(SERVO_ARM)
    return plant(folder / "servo_arm.xml", 1, folder)


def test_healthy_logs_have_nothing_to_say(servo):
    assert run_checks(servo.model, servo.runs) == ()


@pytest.mark.parametrize(
    "mistake", [each for each in MISTAKES if each.name in DOZEN], ids=lambda each: each.name
)
def test_a_mistake_is_reported_in_the_right_words(servo: Plant, mistake: Mistake):
    is_found, found = judge(servo, mistake)
    assert is_found, [each.sentence for each in found]
