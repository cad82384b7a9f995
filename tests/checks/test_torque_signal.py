"""Torques that are no measured torques, each reported by its kind."""

from dataclasses import replace

import numpy as np
import pytest

from identification.parameters import INERTIAL, PER_JOINT, VISCOUS
from recordings.checks import Severity, run_checks
from recordings.checks.subject import Subject
from recordings.checks.torque_signal import check
from testbench.log import Recording
from testbench.robot import Robot

from ..synthetic import synthetic_result, synthetic_robot


@pytest.fixture(scope="module")
def robot(tmp_path_factory) -> Robot:
    return synthetic_robot(tmp_path_factory.mktemp("arm"))


@pytest.fixture(scope="module")
def healthy(robot) -> Recording:
    return synthetic_result(robot).fit_recordings[0]


def _found(robot: Robot, recording: Recording) -> dict[str, tuple[Severity, tuple[str, ...]]]:
    return {each.code: (each.severity, each.joints) for each in check(Subject(robot, {"run": recording}))}


def test_a_healthy_torque_has_nothing_to_say(robot, healthy):
    assert _found(robot, healthy) == {}


def test_torque_without_its_sign_is_reported_with_its_joints(robot, healthy):
    severity, joints = _found(robot, replace(healthy, torque=np.abs(healthy.torque)))["unsigned"]
    assert severity is Severity.STOP
    assert "turn" in joints


def test_velocity_in_the_column_of_torque_is_reported(robot, healthy):
    speed = np.gradient(healthy.position, healthy.time, axis=0)
    found = _found(robot, replace(healthy, torque=speed))
    assert found["velocity_as_torque"] == (Severity.STOP, robot.joint_names)


def test_the_torque_of_a_joint_that_is_little_but_damped_is_no_velocity(robot, healthy):
    """A light wrist whose damping is 1 N·m·s/rad: its torque is its speed."""
    speed = np.gradient(healthy.position, healthy.time, axis=0)
    table = robot.parameters.reshape(-1, PER_JOINT).copy()
    table[2, :INERTIAL] = 0.0
    table[2, INERTIAL:] = 0.0
    table[2, VISCOUS] = 1.2
    damped = replace(robot, parameters=table.ravel())
    torque = healthy.torque.copy()
    torque[:, 2] = speed[:, 2]
    found = check(Subject(damped, {"run": replace(healthy, torque=torque)}))
    assert "velocity_as_torque" not in {each.code for each in found}


def test_torque_that_is_clipped_and_torque_in_coarse_steps_are_distinguished(robot, healthy):
    size = 0.5 * np.abs(healthy.torque).max(axis=0)
    assert "saturated" in _found(robot, replace(healthy, torque=np.clip(healthy.torque, -size, size)))
    step = 0.3 * np.sqrt(np.mean(healthy.torque**2, axis=0))
    found = _found(robot, replace(healthy, torque=np.round(healthy.torque / step) * step))
    assert set(found) == {"quantised"}


def test_torque_that_is_put_to_zero_at_rest_is_reported_and_stops_nothing(robot, healthy):
    rest = np.repeat(healthy.position[:1], 500, axis=0)
    time = np.arange(len(healthy.time) + 500) / healthy.sample_rate
    rested = replace(
        healthy,
        time=time,
        position=np.concatenate([rest, healthy.position]),
        torque=np.concatenate([np.zeros_like(rest), healthy.torque]),
        reference_position=None,
        reference_velocity=None,
    )
    assert _found(robot, rested)["zero_at_rest"] == (Severity.WARN, robot.joint_names)
    found = {each.code: each.sentence for each in run_checks(robot, {"run": rested})}
    assert found["rest"] == f"at rest for {500 / healthy.sample_rate:.2g} s before the motion: not counted"
    assert "zero_at_rest" in found
