"""Models that stand otherwise than the robot: gravity elsewhere or not in the torque, another zero."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis.diagnose import diagnose
from diagnosis.discrimination import next_experiment
from diagnosis.document import diagnosis_document
from diagnosis.frames import Misplaced, in_words, misplaced
from diagnosis.preparation import prepare
from identification.inverse_dynamics import inverse_dynamics
from identification.parameters import INERTIAL, PER_JOINT
from testbench.effects import parse_injection
from testbench.log import Recording
from testbench.robot import Robot

from .diagnosed import simulated_runs
from .diagnosis_output.arm import ARM, LIFT
from .small_arm import small_arm


def _compensated(arm: Robot, run: Recording) -> Recording:
    """The run with its torque less what holds the arm up."""
    still, links = np.zeros_like(run.position), arm.parameters.reshape(-1, PER_JOINT).copy()
    links[:, INERTIAL:] = 0
    return replace(
        run, torque=run.torque - inverse_dynamics(arm.chain, links.ravel(), run.position, still, still)
    )


def _heavier(arm: Robot, times: float) -> Robot:
    table = arm.parameters.reshape(-1, PER_JOINT).copy()
    table[:, :INERTIAL] *= times
    return replace(arm, parameters=table.ravel())


@pytest.mark.parametrize("times", [1.0, 1.2])
@pytest.mark.parametrize("down", [(0.0, 0.0, 9.81), (9.81, 0.0, 0.0), (-6.0, 0.0, -7.8)])
def test_gravity_that_points_elsewhere_is_found_by_roughly_right_masses(arm, healthy_runs, down, times):
    modelled = _heavier(replace(arm, chain=replace(arm.chain, gravity=np.array(down))), times)
    found = misplaced(prepare(modelled, healthy_runs))
    assert found is not None
    assert found.zero is None
    felt = found.gravity / np.linalg.norm(found.gravity)
    # In degrees, which half of the model's error in the masses would be one of.
    assert np.rad2deg(np.arccos(felt @ [0, 0, -1])) < 5
    assert "mounted" in in_words(arm, found)


def test_torque_without_gravity_is_told_in_the_first_sentence(arm, healthy_runs):
    found = diagnose(arm, {name: _compensated(arm, run) for name, run in healthy_runs.items()})
    assert found.sentence.startswith("The logged torque has no gravity in it")
    assert (found.verdict, found.effects) == ("unknown", ())
    assert next_experiment(found) is None
    told = diagnosis_document(found)["misplaced"]
    # A twentieth of what the model has, by masses that are the robot's.
    assert np.linalg.norm(told["gravity"]) < 0.5
    assert told["zero"] is None


def test_a_zero_of_another_convention_is_found_with_its_joint_and_angle(tmp_path):
    crane = small_arm(tmp_path, ARM)
    off = np.eye(crane.joints)[LIFT] * np.pi / 2
    runs = simulated_runs(crane, [], runs=2).items()
    found = misplaced(prepare(crane, {name: replace(run, position=run.position + off) for name, run in runs}))
    assert found is not None
    assert found.zero is not None
    assert found.zero[0] == LIFT
    # A degree, as friction is not known while it is looked for.
    assert found.zero[1] == pytest.approx(np.pi / 2, abs=np.deg2rad(1))
    assert "lift 90° from" in in_words(crane, Misplaced(crane.chain.gravity, (LIFT, np.pi / 2)))


@pytest.mark.parametrize("turned", [(0,), (0, 1)])
def test_joints_that_turn_the_other_way_are_told(arm, healthy_runs, turned):
    sign = np.where(np.isin(np.arange(arm.joints), turned), -1.0, 1.0)
    backwards = {
        name: replace(run, position=sign * run.position, torque=sign * run.torque)
        for name, run in healthy_runs.items()
    }
    found = misplaced(prepare(arm, backwards))
    assert found is not None
    assert (found.zero, found.turned) == (None, turned)
    assert "the other way than in the model" in in_words(arm, found)


def test_a_cable_of_one_joint_is_no_gravity(arm):
    cable = parse_injection(arm, "cable_spring:elbow:stiffness=3,rest=0.4")
    assert misplaced(prepare(arm, simulated_runs(arm, [cable]))) is None


@pytest.mark.parametrize("times", [0.7, 1.0, 1.4])
def test_a_model_with_wrong_masses_stands_as_the_robot_does(arm, healthy_runs, times):
    assert misplaced(prepare(_heavier(arm, times), healthy_runs)) is None
