"""A dual arm and four legs on a held trunk: what acts on one branch stays on it, and they are identified."""

from pathlib import Path

import mujoco
import numpy as np
import pytest

from identification.inverse_dynamics import inverse_dynamics
from identification.models import observe
from identification.parameters import PER_JOINT
from identification.pipeline import IdentificationOptions, identify
from identification.signals import Motion
from testbench.clearance import robot_clearance
from testbench.effects.link_force import base_in_link, wrench_torques
from testbench.effects.logged import body_in_link
from testbench.robot import Robot

from .simulated_arm import robot_from
from .trees import DUAL_ARM, FOUR_LEGS

STEP, RATE, NOISE = 1e-6, 500.0, 0.05


@pytest.fixture(scope="module")
def dual_arm(tmp_path_factory: pytest.TempPathFactory) -> Robot:
    hand = '<geom type="sphere" size=".05" pos="0 0 -.2"/></body>'
    lower = DUAL_ARM.replace('fullinertia=".012 .013 .004 .0003 .0006 .0002"/>', "{}").split("{}")
    inertia = 'fullinertia=".012 .013 .004 .0003 .0006 .0002"/>'
    xml = (inertia + hand.removesuffix("</body>")).join(lower)
    return robot_from(xml, tmp_path_factory.mktemp("dual_arm"))


def test_a_force_on_a_link_loads_its_own_branch_as_mujoco_has_it(dual_arm: Robot) -> None:
    model, data = dual_arm.model, mujoco.MjData(dual_arm.model)
    q = np.random.default_rng(0).uniform(-1, 1, (1, dual_arm.joints))
    data.qpos[:] = q[0]
    mujoco.mj_forward(model, data)
    joint = 4
    assert dual_arm.chain.path(joint) == [3, 4]
    axes = base_in_link(dual_arm.chain, q, joint)[0]
    body, expected = int(model.jnt_bodyid[joint]), np.zeros((6, model.nv))
    # Unit forces and couples at the link's origin, which is the joint's anchor.
    for k in range(3):
        along = axes[k]
        mujoco.mj_applyFT(model, data, along, np.zeros(3), data.xanchor[joint], body, expected[k])
        mujoco.mj_applyFT(model, data, np.zeros(3), along, data.xanchor[joint], body, expected[3 + k])
    ours = np.zeros((model.nv, 6))
    ours[dual_arm.chain.path(joint)] = wrench_torques(dual_arm.chain, q, joint)[0]
    np.testing.assert_allclose(ours, expected.T, rtol=0, atol=1e-12)


def test_the_frame_of_a_body_is_found_on_its_branch(dual_arm: Robot) -> None:
    for joint in range(dual_arm.joints):
        _, origin = body_in_link(dual_arm, joint)
        np.testing.assert_allclose(origin, 0.0, atol=1e-12)


def test_clearance_between_branches_has_the_gradient_of_finite_differences(dual_arm: Robot) -> None:
    clearance = robot_clearance(dual_arm, 0.05)
    assert clearance is not None
    assert len(clearance.pairs) == 1
    q = np.array([[-0.55, 0.3, -0.2, 0.5, 0.2, 0.1], [-0.45, 0.1, 0.3, 0.55, 0.15, 0.1]])
    distances, gradients = clearance.gradients(q)
    assert np.all((distances > 0.001) & (distances < 0.19)), distances
    for joint, unit in enumerate(STEP * np.eye(dual_arm.joints)):
        difference = (clearance.distances(q + unit) - clearance.distances(q - unit)) / (2 * STEP)
        np.testing.assert_allclose(gradients[:, :, joint], difference, rtol=0, atol=1e-6)


def test_four_legs_on_a_held_trunk_are_identified_to_the_noise(tmp_path: Path) -> None:
    robot = robot_from(FOUR_LEGS, tmp_path)
    fitted, validation = (_motion(robot, seed) for seed in (1, 2))
    options = IdentificationOptions()
    runs = {"fitted": fitted}, {"validation": validation}
    found = identify(robot.chain, robot.parameters, *runs, options)
    base = found.estimate.base
    left = observe(robot.chain, base, validation, options.preprocessing, "validation")
    truth = np.where(left.used, left.torque - left.regressor @ base.values(robot.parameters), 0.0)
    floor = np.sqrt(np.sum(truth**2, axis=0) / left.used.sum(axis=0))
    assert np.all(found.validations[0].rms < 1.15 * floor)
    # A leg's parameters are regrouped with those of no other.
    legs = [{int(column) // PER_JOINT // 3 for column in np.flatnonzero(row)} for row in base.projection]
    assert all(len(leg) == 1 for leg in legs)


def _motion(robot: Robot, seed: int) -> Motion:
    """Twelve seconds of sines with noise on the torque."""
    rng = np.random.default_rng(seed)
    time = np.arange(0, 12, 1 / RATE)
    q, dq, ddq = np.zeros((3, len(time), robot.joints))
    for w in 2 * np.pi * np.array([0.23, 0.4, 0.7, 1.1, 1.7]):
        a, phase = rng.uniform(0.05, 0.2, robot.joints), rng.uniform(0, 2 * np.pi, robot.joints)
        angle = w * time[:, None] + phase
        q += a * np.sin(angle)
        dq += a * w * np.cos(angle)
        ddq -= a * w**2 * np.sin(angle)
    torque = inverse_dynamics(robot.chain, robot.parameters, q, dq, ddq)
    return Motion(q, torque + NOISE * rng.standard_normal(torque.shape), RATE)
