"""Positions that no robot has: wrapped, broken, degrees for radians, the command's own."""

from dataclasses import replace

import numpy as np
import pytest

from identification.errors import InputError
from recordings.checks.positions import require_plausible_motion
from testbench.log import Recording
from testbench.robot import Robot

from ..synthetic import synthetic_result, synthetic_robot


@pytest.fixture(scope="module")
def robot(tmp_path_factory) -> Robot:
    return synthetic_robot(tmp_path_factory.mktemp("arm"))


@pytest.fixture(scope="module")
def healthy(robot) -> Recording:
    """Four seconds of a turret, a lift and a ram."""
    return synthetic_result(robot).fit_recordings[0]


def _moved(recording: Recording, change: np.ndarray) -> Recording:
    return replace(recording, position=recording.position + change)


def _check_motion(robot: Robot, recording: Recording) -> None:
    require_plausible_motion(recording, robot.chain, robot.limits, "log.h5")


def test_a_healthy_log_passes(robot, healthy):
    _check_motion(robot, healthy)


def test_a_position_that_wraps_is_reported_with_its_joint_and_time(robot, healthy):
    wrapped = healthy.position.copy()
    wrapped[1000:, 0] -= 2 * np.pi
    with pytest.raises(
        InputError, match=r"log.h5: joint/position: .* got a step of -6.28 rad at 2 s at turn"
    ):
        _check_motion(robot, replace(healthy, position=wrapped))


def test_a_slide_that_steps_by_six_metres_is_no_wrap(robot, healthy):
    limits = replace(robot.limits, lower=robot.limits.lower - 9, upper=robot.limits.upper + 9)
    moved = healthy.position.copy()
    moved[1000:, 2] += 2 * np.pi
    with pytest.raises(InputError, match=r"got a step of 6.28 m at 2 s at reach \(are samples missing"):
        require_plausible_motion(replace(healthy, position=moved), robot.chain, limits, "log.h5")


def test_two_runs_in_one_log_are_reported_and_a_late_packet_is_let_pass(robot, healthy):
    glued = healthy.position.copy()
    glued[1000:] = healthy.position[np.minimum(np.arange(1300, len(glued) + 300), len(glued) - 1)]
    with pytest.raises(
        InputError, match="joint/position: expected continuous positions, got a step of .* at 2 s"
    ):
        _check_motion(robot, replace(healthy, position=glued))
    late = healthy.position.copy()
    late[1000:1005] = late[999]
    _check_motion(robot, replace(healthy, position=late))


def test_a_joint_at_rest_that_settles_by_some_counts_is_let_pass(robot, healthy):
    resting = healthy.position.copy()
    resting[:, 1] = np.where(np.arange(len(resting)) < 1000, 0.3, 0.3 + 3e-5)
    resting[500:502, 1] += 1e-6
    resting[1500:, 1] = 0.3 + healthy.position[1500:, 1] - healthy.position[1500, 1]
    _check_motion(robot, replace(healthy, position=resting))


def test_positions_that_are_the_reference_are_reported(robot, healthy):
    followed = replace(healthy, reference_position=healthy.position.copy())
    with pytest.raises(InputError, match="expected measured positions, got those of reference/position"):
        _check_motion(robot, followed)


def test_a_joint_that_turns_so_fast_does_not_wrap(robot, healthy):
    limits = replace(robot.limits, lower=np.full(3, -np.inf), upper=np.full(3, np.inf))
    turning = healthy.position.copy()
    turning[:, 0] = np.cumsum(np.where(np.arange(len(turning)) % 2, 5.0, 6.3))
    require_plausible_motion(replace(healthy, position=turning), robot.chain, limits, "log.h5")


def test_one_spoiled_sample_is_no_wrap_and_not_out_of_range(robot, healthy):
    for change in (2 * np.pi, 400.0):
        spoiled = healthy.position.copy()
        spoiled[700, 0] += change
        _check_motion(robot, replace(healthy, position=spoiled))


def test_degrees_are_reported_with_the_range_and_the_value(robot, healthy):
    with pytest.raises(InputError) as refused:
        _check_motion(robot, replace(healthy, position=np.rad2deg(healthy.position)))
    line = str(refused.value)
    assert line.startswith(
        "log.h5: joint/position: expected positions of turn about the model's range of -3 to 3"
    )
    assert line.endswith("(are these degrees?)")


def test_a_zero_that_lies_elsewhere_is_let_pass(robot, healthy):
    _check_motion(robot, _moved(healthy, np.array([3.0, 2.0, 0.2])))
