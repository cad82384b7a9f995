"""What runs leave open stays at the model, is said in words, and costs well excited runs nothing."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from identification.base_parameters import base_parameters
from identification.errors import InputError
from identification.estimators import estimate
from identification.held_estimate import Held, held_estimate
from identification.inverse_dynamics import inverse_dynamics
from identification.models import Preprocessing, observe
from identification.parameters import GROUPS
from identification.problem import Problem
from identification.signals import Motion
from testbench.robot import Robot

from .small_arm import small_arm

RATE, SECONDS, NOISE = 200.0, 30.0, 0.02
WRONG = 1.1


@pytest.fixture(scope="module")
def robot(tmp_path_factory: pytest.TempPathFactory) -> Robot:
    return small_arm(tmp_path_factory.mktemp("robot"))


def problem(robot: Robot, amplitudes: NDArray[np.float64]) -> Problem:
    """Sines of these amplitudes (lines, n), rad, at .2 Hz a line apart; the model is WRONG by a factor."""
    time = np.arange(int(SECONDS * RATE)) / RATE
    lines, joints = amplitudes.shape
    turns = 2 * np.pi * 0.2 * np.arange(1, lines + 1)[:, None]
    phase = np.arange(joints) + np.arange(lines)[:, None]
    angle = turns * time[:, None, None] + phase
    q = np.sum(amplitudes * np.sin(angle), axis=1)
    dq = np.sum(amplitudes * turns * np.cos(angle), axis=1)
    ddq = -np.sum(amplitudes * turns**2 * np.sin(angle), axis=1)
    torque = inverse_dynamics(robot.chain, robot.parameters, q, dq, ddq)
    scale = np.sqrt(np.mean(torque**2, axis=0))
    torque += NOISE * scale * np.random.default_rng(0).standard_normal(torque.shape)
    motion = Motion(q, torque, RATE)
    base, settings = base_parameters(robot.chain, tuple(GROUPS)), Preprocessing()
    run = observe(robot.chain, base, motion, settings)
    return Problem(robot.chain, base, (run,), (motion,), settings, WRONG * robot.parameters)


@pytest.fixture(scope="module")
def one_still(robot: Robot) -> tuple[Problem, Held]:
    amplitudes = np.full((4, robot.joints), 0.3)
    amplitudes[:, -1] = 0.0
    posed = problem(robot, amplitudes)
    return posed, held_estimate(posed, "wls")


def test_a_joint_that_stands_still_keeps_its_friction_and_is_named(
    robot: Robot, one_still: tuple[Problem, Held]
) -> None:
    posed, held = one_still
    still = f"fc_{robot.joints}"
    index = held.estimate.base.names.index(still)
    given = posed.base.values(posed.nominal)
    assert held.estimate.values[index] == pytest.approx(given[index], rel=1e-6)
    assert not held.determination.determined[index]
    assert held.determination.remarks == (f"{robot.joint_names[-1]} stood still",)
    assert held.determination.directions < posed.base.count


def test_a_joint_that_moves_gets_its_friction_from_the_log(
    robot: Robot, one_still: tuple[Problem, Held]
) -> None:
    posed, held = one_still
    index = held.estimate.base.names.index("fc_1")
    truth = posed.base.values(robot.parameters)
    assert held.determination.determined[index]
    assert abs(held.estimate.values[index] - truth[index]) < 3 * held.estimate.std[index]


def test_what_no_row_tells_is_as_uncertain_as_the_models_own_width(
    one_still: tuple[Problem, Held],
) -> None:
    posed, held = one_still
    index = held.estimate.base.names.index(f"fc_{posed.chain.joints}")
    # A third of the friction and a hundredth of the joint's torque, or wider where the model is far off.
    assert held.estimate.std[index] >= 0.35 * posed.base.values(posed.nominal)[index]


def test_strictly_such_a_run_is_refused(one_still: tuple[Problem, Held]) -> None:
    with pytest.raises(InputError, match="nothing that reveals"):
        estimate(one_still[0], "wls")


@pytest.mark.parametrize("estimator", ["ols", "wls", "irls", "physically_consistent"])
def test_every_estimator_that_takes_a_prior_predicts_better_than_the_model(
    robot: Robot, one_still: tuple[Problem, Held], estimator: str
) -> None:
    posed, _ = one_still
    found = held_estimate(posed, estimator).estimate
    (run,) = posed.observations

    def error(values: NDArray[np.float64]) -> float:
        return float(np.linalg.norm(np.where(run.used, run.residual(values), 0.0)))

    assert error(found.values) < 0.5 * error(posed.base.values(posed.nominal))


def test_well_excited_parameters_move_by_a_small_part_of_their_deviation(robot: Robot) -> None:
    posed = problem(robot, np.full((5, robot.joints), 0.25))
    free, held = estimate(posed, "wls"), held_estimate(posed, "wls").estimate
    width = np.sqrt(np.diag(held_prior(posed)))
    known = free.std < 0.1 * width
    assert known.sum() >= 5
    assert np.max(np.abs(held.values - free.values)[known] / free.std[known]) < 0.2


def held_prior(posed: Problem) -> NDArray[np.float64]:
    from identification.held_estimate import motion_scales
    from identification.prior import base_prior, parameter_widths

    widths = parameter_widths(posed.nominal, *motion_scales(posed))
    return base_prior(posed.base, posed.nominal, widths).covariance


def test_one_sine_on_a_joint_is_said(robot: Robot) -> None:
    amplitudes = np.full((5, robot.joints), 0.25)
    amplitudes[1:, 0] = 0.0
    amplitudes[0, 0] = 0.5
    (remark,) = held_estimate(problem(robot, amplitudes), "wls").determination.remarks
    assert remark.startswith(f"{robot.joint_names[0]} follows one sine at one frequency")


def test_a_joints_own_band_is_its_rows_alone(robot: Robot) -> None:
    posed = problem(robot, np.full((3, robot.joints), 0.3))
    narrow = replace(Preprocessing(), joint_cutoffs=(8.0, *(20.0,) * (robot.joints - 1)))
    before = posed.observations[0]
    after = observe(robot.chain, posed.base, posed.motions[0], narrow)
    # The narrower filter spoils more of both ends.
    offset = int(np.argmin(np.abs(before.time - after.time[0])))
    same = before.torque[offset : offset + len(after.torque)]
    np.testing.assert_allclose(after.torque[:, 1:], same[:, 1:], rtol=1e-9)
    assert np.std(after.torque[:, 0] - same[:, 0]) > 0
