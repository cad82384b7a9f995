"""Logs that no robot gives: positions that wrap, degrees for radians, torque backwards or another joint's."""

from dataclasses import replace

import numpy as np
import pytest
from testbench.plausible_log import check_motion, check_torque

from identification.errors import InputError
from identification.parameters import ARMATURE, COULOMB, INERTIAL, PER_JOINT
from testbench.cli import main
from testbench.log import Recording, write_log
from testbench.robot import Robot

from .synthetic import synthetic_result, synthetic_robot


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
    check_motion(recording, robot.chain, robot.limits, "log.h5")


def _check_torque(robot: Robot, recording: Recording, parameters: np.ndarray | None = None) -> None:
    given = robot.parameters if parameters is None else parameters
    check_torque(recording, robot.chain, given, "log.h5")


def test_a_healthy_log_passes(robot, healthy):
    _check_motion(robot, healthy)
    _check_torque(robot, healthy)


def test_a_position_that_wraps_is_told_with_its_joint_and_time(robot, healthy):
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
        check_motion(replace(healthy, position=moved), robot.chain, limits, "log.h5")


def test_two_runs_in_one_log_are_told_and_a_late_packet_is_let_pass(robot, healthy):
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


def test_positions_that_are_the_reference_are_told(robot, healthy):
    followed = replace(healthy, reference_position=healthy.position.copy())
    with pytest.raises(InputError, match="expected measured positions, got those of reference/position"):
        _check_motion(robot, followed)


def test_a_joint_that_turns_so_fast_does_not_wrap(robot, healthy):
    limits = replace(robot.limits, lower=np.full(3, -np.inf), upper=np.full(3, np.inf))
    turning = healthy.position.copy()
    turning[:, 0] = np.cumsum(np.where(np.arange(len(turning)) % 2, 5.0, 6.3))
    check_motion(replace(healthy, position=turning), robot.chain, limits, "log.h5")


def test_one_spoiled_sample_is_no_wrap_and_not_out_of_range(robot, healthy):
    for change in (2 * np.pi, 400.0):
        spoiled = healthy.position.copy()
        spoiled[700, 0] += change
        _check_motion(robot, replace(healthy, position=spoiled))


def test_degrees_are_told_with_the_range_and_the_value(robot, healthy):
    with pytest.raises(InputError) as refused:
        _check_motion(robot, replace(healthy, position=np.rad2deg(healthy.position)))
    line = str(refused.value)
    assert line.startswith(
        "log.h5: joint/position: expected positions of turn about the model's range of -3 to 3"
    )
    assert line.endswith("(are these degrees?)")


def test_a_zero_that_lies_elsewhere_is_let_pass(robot, healthy):
    _check_motion(robot, _moved(healthy, np.array([3.0, 2.0, 0.2])))


@pytest.mark.parametrize("joints", [(0, 1, 2), (1,)])
def test_torque_counted_backwards_is_told_with_its_joints(robot, healthy, joints):
    sign = np.ones(3)
    sign[list(joints)] = -1
    names = ", ".join(robot.joint_names[joint] for joint in joints)
    with pytest.raises(InputError, match=f"joint/torque: expected the sign .*, got the opposite at {names}$"):
        _check_torque(robot, replace(healthy, torque=healthy.torque * sign))


def test_torque_without_its_sign_is_told_with_its_joints(robot, healthy):
    with pytest.raises(InputError, match="none below zero at turn"):
        _check_torque(robot, replace(healthy, torque=np.abs(healthy.torque)))


def test_a_joint_that_friction_holds_has_not_lost_its_sign(robot, healthy):
    position, torque = healthy.position.copy(), healthy.torque.copy()
    rising = 0.05 * (1 - np.cos(np.pi * np.minimum(healthy.time, 1.0)))
    # One count this way, one that way: the model's friction has either sign.
    position[:, 0] = rising + 1e-6 * np.random.default_rng(1).integers(0, 2, len(rising))
    torque[:, 0] = 0.9 * robot.parameters.reshape(-1, PER_JOINT)[0, COULOMB]
    _check_torque(robot, replace(healthy, position=position, torque=torque))


def test_positions_counted_backwards_are_told(robot, healthy):
    with pytest.raises(InputError, match="got the opposite at turn$"):
        _check_torque(robot, replace(healthy, position=healthy.position * [-1, 1, 1]))


def test_friction_that_drives_a_joint_is_torque_counted_backwards(robot, healthy):
    table = robot.parameters.reshape(-1, PER_JOINT).copy()
    table[:, :INERTIAL] *= 1e-3
    light = table.ravel()
    friction = np.sign(np.gradient(healthy.position, healthy.time, axis=0)) * [1, -1, 1]
    rubbing = replace(healthy, torque=3.0 * friction)
    with pytest.raises(InputError, match=f"got the opposite at {robot.joint_names[1]}$"):
        _check_torque(robot, rubbing, light)


def test_a_model_with_wrong_masses_and_no_friction_refuses_no_healthy_log(robot, healthy):
    rng = np.random.default_rng(2)
    for _ in range(20):
        table = robot.parameters.reshape(-1, PER_JOINT) * np.exp(rng.normal(size=(3, PER_JOINT)))
        table[:, INERTIAL:] = 0
        table[:, ARMATURE] = 0
        _check_torque(robot, healthy, table.ravel())


@pytest.mark.parametrize("channel", ["torque", "position"])
@pytest.mark.parametrize("order", [(1, 0, 2), (0, 2, 1)])
def test_columns_that_are_swapped_are_told_with_their_joints(robot, healthy, channel, order):
    names = robot.joint_names
    pairs = [(joint, other) for joint, other in enumerate(order) if joint != other]
    got = ", ".join(f"{names[joint]}'s following the motion of {names[other]}" for joint, other in pairs)
    swapped = replace(healthy, **{channel: getattr(healthy, channel)[:, list(order)]})
    with pytest.raises(
        InputError, match=f"joint/torque: expected .* in the order of joint_names, got {got}$"
    ):
        _check_torque(robot, swapped)


def test_gravity_that_points_the_other_way_is_left_to_the_diagnosis(robot, healthy):
    chain = replace(robot.chain, gravity=-robot.chain.gravity)
    check_torque(healthy, chain, robot.parameters, "log.h5")


def test_a_log_too_short_to_tell_is_let_pass(robot, healthy):
    short = slice(0, 500)
    few = replace(
        healthy, time=healthy.time[short], position=healthy.position[short], torque=-healthy.torque[short]
    )
    _check_torque(robot, few)


@pytest.mark.parametrize("command", ["identify", "diagnose"])
def test_commands_refuse_such_a_log_by_its_file(robot, healthy, tmp_path, capsys, command):
    backwards = replace(healthy, torque=-healthy.torque, reference_position=None, reference_velocity=None)
    path = tmp_path / "run.h5"
    write_log(backwards, path)
    with pytest.raises(SystemExit, match="2"):
        main([command, "--model", str(robot.path), str(path), "--out", str(tmp_path / "out")])
    assert capsys.readouterr().err.startswith(f"{path}: joint/torque: expected the sign")


def test_a_joint_that_is_thrown_for_a_moment_does_not_count_backwards(robot, healthy):
    table = robot.parameters.reshape(-1, PER_JOINT).copy()
    table[:, :INERTIAL] *= 1e-3
    time, position = healthy.time, healthy.position.copy()
    thrown = np.exp(-(((time - 2.0) / 0.1) ** 2))
    speed = 0.1 * np.sign(np.sin(4 * time)) + 2.0 * thrown
    position[:, 1] = np.cumsum(speed) * (time[1] - time[0])
    torque = healthy.torque.copy()
    # Its own drive holds against what throws it.
    torque[:, 1] = 0.5 * np.sign(speed) - 30.0 * thrown
    _check_torque(robot, replace(healthy, position=position, torque=torque), table.ravel())
