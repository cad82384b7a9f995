"""What a sentence claims of the gap: as much as left-out runs bear out."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis.decision.findings import Diagnosis, Gap
from diagnosis.report.sentence import sentence_of
from diagnosis.report.summary import summary
from diagnosis.report.words import where
from testbench.robot import Robot

from ...diagnosed import exact_gap

TORQUE = np.array([10.0, 100.0, 20.0])


def _gap(left: tuple[float, ...], noise: tuple[float, ...], unseen: bool = False) -> Gap:
    """A gap whose re-identified parameters leave this of each joint, N·m."""
    gap = exact_gap(2 * np.array(left), np.array(left), np.array(left), np.array(noise))
    return replace(gap, unseen=np.full(3, unseen))


@pytest.mark.parametrize(
    ("left", "noise", "unseen", "said"),
    [
        ((0.5, 2.0, 3.0), (0.5, 2.0, 3.0), False, "explains them to the noise"),
        ((0.3, 2.0, 0.8), (0.01, 0.01, 0.01), False, "explains them to 4.0% of each joint's torque"),
        ((0.3, 28.0, 0.8), (0.01, 0.7, 0.01), False, "leaves 28% of the torque of lift"),
        ((0.3, 28.0, 0.8), (0.01, 0.7, 0.01), False, " 40 times the noise, without a named cause"),
        ((0.3, 28.0, 0.8), (0.01, 0.7, 0.01), True, " at least 40 times the noise"),
    ],
)
def test_parameters_explain_a_log_where_they_predict_left_out_runs(
    robot: Robot, left: tuple[float, ...], noise: tuple[float, ...], unseen: bool, said: str
) -> None:
    sentence = sentence_of(robot, "parameters", (), (), _gap(left, noise, unseen), TORQUE)
    assert said in sentence
    assert ("explains them" in sentence) == ("explains them" in said)


def test_a_model_that_needs_nothing_says_what_it_leaves(robot: Robot) -> None:
    gap = _gap((0.3, 14.0, 0.8), (0.01, 0.7, 0.01))
    assert "leaves 28% of the torque of lift" in sentence_of(robot, "none", (), (), gap, TORQUE)


def test_joints_are_listed_by_their_share_of_the_gap(answer: Diagnosis) -> None:
    shares = [each.share for each in answer.where]
    assert shares == sorted(shares, reverse=True)
    largest = replace(answer.where[0], share=0.81, regime="slow")
    other = replace(answer.where[1], share=0.19, regime="everywhere")
    names = answer.robot.joint_names
    first, second = names[largest.joint], names[other.joint]
    text = where(replace(answer, where=(largest, other)))
    assert text == f"{first} 81 %, densest: slow; {second} 19 %"


def test_a_noise_floor_that_is_a_bound_says_so(answer: Diagnosis) -> None:
    assert ", noise at most " not in summary(answer).plain
