"""Robots with branches against Pinocchio, MuJoCo and finite differences."""

import tempfile
from pathlib import Path

import mujoco
import numpy as np
import pinocchio
import pytest
from hypothesis import given, settings

from identification.base_parameters import base_parameters
from identification.chain import Chain, chain_from_model, frame_with_z
from identification.energy import energy_regressor
from identification.errors import InputError
from identification.forward_dynamics import accelerate
from identification.inverse_dynamics import inverse_dynamics, mass_matrices
from identification.parameters import COULOMB, GROUPS, INERTIAL, PER_JOINT, VISCOUS, pseudo_inertia
from identification.regressor import regressor
from identification.regressor_adjoint import regressor_adjoint
from testbench.jobs.parity import mujoco_torques

from .trees import Tree, tree_xml, trees

SAMPLES = 5
TOLERANCE = {"rtol": 0, "atol": 1e-9}  # N·m, N, kg·m²
# Where Pinocchio keeps XX XY XZ YY YZ ZZ MX MY MZ M among its ten.
PINOCCHIO_ORDER = np.array([4, 5, 7, 6, 8, 9, 1, 2, 3, 0])
COULOMB_VELOCITY, STEP = 0.3, 1e-5
# Two branches from joint 0, one of which has two of its own, and a second root.
PARENTS = [-1, 0, 1, 0, 3, 3, 5, -1, 7]
SLIDES = [False, False, True, False, False, False, True, True, False]
every_tree = settings(max_examples=25, deadline=None, derandomize=True)


@pytest.fixture(scope="module")
def branched() -> tuple[Chain, np.ndarray]:
    return chain_from_model(mujoco.MjModel.from_xml_string(tree_xml(PARENTS, SLIDES)))


def states(joints: int) -> np.ndarray:
    """q, dq, ddq, each (SAMPLES, joints)."""
    return np.random.default_rng(0).uniform(-2, 2, (3, SAMPLES, joints))


def by_pinocchio(xml: str) -> tuple[pinocchio.Model, pinocchio.Data]:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "tree.xml"
        path.write_text(xml)
        model = pinocchio.buildModelFromMJCF(str(path))
    return model, model.createData()


def turned(columns: np.ndarray, axes: np.ndarray) -> np.ndarray:
    """Regressor columns (..., 10) of a link, for parameters in a frame whose axes are turned by (3, 3)."""
    pose = np.eye(4)
    pose[:3, :3] = axes.T
    change = np.empty((INERTIAL, INERTIAL))
    for unit in np.eye(INERTIAL):
        moved = pose @ pseudo_inertia(unit) @ pose.T
        inertia = np.trace(moved[:3, :3]) * np.eye(3) - moved[:3, :3]
        change[:, unit == 1] = np.r_[
            inertia[[0, 0, 0, 1, 1, 2], [0, 1, 2, 1, 2, 2]], moved[:3, 3], moved[3, 3]
        ][:, None]
    return columns @ change


@given(trees())
@every_tree
def test_dynamics_of_trees_are_those_of_pinocchio_and_mujoco(tree: Tree) -> None:
    model = mujoco.MjModel.from_xml_string(tree.xml)
    chain, parameters = chain_from_model(model)
    q, dq, ddq = states(chain.joints)
    table = parameters.reshape(-1, PER_JOINT)
    np.testing.assert_array_equal(chain.parent, tree.parents)

    torque = inverse_dynamics(chain, parameters, q, dq, ddq)
    rows = regressor(chain, q, dq, ddq)
    np.testing.assert_allclose(rows @ parameters, torque, **TOLERANCE)
    coulomb = table[:, COULOMB] * np.sign(dq)
    np.testing.assert_allclose(mujoco_torques(model, q, dq, ddq) + coulomb, torque, **TOLERANCE)

    theirs, data = by_pinocchio(tree.xml)
    joint_friction = table[:, VISCOUS] * dq + coulomb
    mass = mass_matrices(chain, parameters, q)
    without_coulomb = np.where(np.arange(PER_JOINT) == COULOMB, 0.0, table)
    robot = (chain.arrays, without_coulomb, table[:, COULOMB], np.full(chain.joints, 1e-9))
    for t in range(SAMPLES):
        state = q[t], dq[t], ddq[t]
        rnea = pinocchio.rnea(theirs, data, *state)
        np.testing.assert_allclose(rnea + joint_friction[t], torque[t], **TOLERANCE)
        upper = np.triu(pinocchio.crba(theirs, data, q[t]))
        np.testing.assert_allclose(upper + np.triu(upper, 1).T, mass[t], **TOLERANCE)
        own = pinocchio.computeJointTorqueRegressor(theirs, data, *state)
        # Joints of one body are one joint of Pinocchio's, with a frame of its own.
        for joint in range(chain.joints if theirs.njoints == chain.joints + 1 else 0):
            axes = frame_with_z(model.jnt_axis[joint])
            ours = turned(rows[t, :, PER_JOINT * joint :][:, :INERTIAL], axes)
            block = own[:, INERTIAL * joint :][:, PINOCCHIO_ORDER]
            np.testing.assert_allclose(block, ours, **TOLERANCE)
        work = tuple(np.empty((chain.joints + 1, chain.joints)) for _ in range(3))
        found, factor = np.empty(chain.joints), np.empty((chain.joints, chain.joints))
        assert accelerate(robot, q[t], dq[t], torque[t], work, np.empty_like(work[0]), factor, found)
        aba = pinocchio.aba(theirs, data, q[t], dq[t], torque[t] - joint_friction[t])
        np.testing.assert_allclose(mass[t] @ found, mass[t] @ aba, **TOLERANCE)
        np.testing.assert_allclose(mass[t] @ found, mass[t] @ ddq[t], **TOLERANCE)


def test_the_adjoint_is_that_of_finite_differences(branched: tuple[Chain, np.ndarray]) -> None:
    chain, _ = branched
    motion = states(chain.joints)
    columns = np.arange(0, PER_JOINT * chain.joints, 3)
    seeds = np.random.default_rng(3).normal(size=(SAMPLES, chain.joints, len(columns)))
    bars = regressor_adjoint(chain, *motion, seeds, columns, COULOMB_VELOCITY)
    differences = np.empty_like(motion)
    for order in range(3):
        for joint in range(chain.joints):
            ends = []
            for step in (STEP, -STEP):
                moved = motion.copy()
                moved[order, :, joint] += step
                matrix = regressor(chain, *moved, columns=columns, coulomb_velocity=COULOMB_VELOCITY)
                ends.append(np.sum(matrix * seeds, axis=(1, 2)))
            differences[order, :, joint] = (ends[0] - ends[1]) / (2 * STEP)
    np.testing.assert_allclose(bars, differences, rtol=0, atol=1e-7 * np.abs(differences).max())


def test_energy_grows_by_the_power_put_in(branched: tuple[Chain, np.ndarray]) -> None:
    chain, parameters = branched
    table = parameters.reshape(-1, PER_JOINT).copy()
    table[:, [VISCOUS, COULOMB]] = 0.0
    rate = np.random.default_rng(1).uniform(1, 3, chain.joints)
    columns = np.arange(table.size)

    def energy(time: np.ndarray) -> np.ndarray:
        angle = np.multiply.outer(time, rate)
        return energy_regressor(chain, np.sin(angle), rate * np.cos(angle), columns) @ table.ravel()

    time = np.linspace(0, 2, 9)
    angle = np.multiply.outer(time, rate)
    q, dq, ddq = np.sin(angle), rate * np.cos(angle), -(rate**2) * np.sin(angle)
    power = np.sum(dq * inverse_dynamics(chain, table.ravel(), q, dq, ddq), axis=1)
    grown = (energy(time + STEP) - energy(time - STEP)) / (2 * STEP)
    np.testing.assert_allclose(grown, power, rtol=0, atol=1e-7 * np.abs(power).max())


def test_base_parameters_of_a_tree_predict_its_torque(branched: tuple[Chain, np.ndarray]) -> None:
    chain, parameters = branched
    base = base_parameters(chain, tuple(GROUPS))
    motion = states(chain.joints)
    torque = regressor(chain, *motion) @ parameters
    predicted = regressor(chain, *motion, columns=base.columns) @ base.values(parameters)
    np.testing.assert_allclose(predicted, torque, rtol=0, atol=1e-6 * np.abs(torque).max())


def test_no_other_parameters_load_a_joint_than_those_said_to(branched: tuple[Chain, np.ndarray]) -> None:
    chain, _ = branched
    rng = np.random.default_rng(6)
    rows = regressor(chain, *rng.uniform(-1, 1, (3, SAMPLES, chain.joints)))
    for joint in range(chain.joints):
        (loads,) = np.nonzero(rows[:, joint].any(axis=0))
        own = chain.loading(joint)
        assert own.start == PER_JOINT * joint <= loads.min()
        assert loads.max() < own.stop
    assert chain.loading(2).stop == PER_JOINT * 3
    assert chain.loading(3).stop == PER_JOINT * 7


def test_links_are_regrouped_into_the_link_that_carries_them() -> None:
    upright = '<joint name="{0}" axis="0 1 0"/><inertial pos=".1 0 .1" mass="1" diaginertia=".1 .1 .1"/>'
    arm = (
        '<body pos="0 {1} 1">'
        + upright
        + '<body pos=".5 0 0">'
        + upright.replace("{0}", "{0}_elbow")
        + "</body></body>"
    )
    turn = '<joint name="turn" axis="0 0 1"/><inertial pos=".1 0 0" mass="3" diaginertia=".1 .1 .1"/>'
    post = f"<body>{turn}{{}}</body>"
    xml = post.format(arm.format("left", 0.3) + arm.format("right", -0.2))
    chain, _ = chain_from_model(
        mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{xml}</worldbody></mujoco>")
    )
    assert chain.joint_names == ("turn", "left", "left_elbow", "right", "right_elbow")
    names = base_parameters(chain, ("inertial",)).names
    # The post feels both arms, an arm nothing of the other.
    assert {"YY_2", "YY_4"} <= set(names[0].replace("+ ", "").replace("- ", "").split())
    left, right = (next(name for name in names if name.startswith(f"ZZ_{joint} ")) for joint in (2, 4))
    assert [joint for joint in "35" if f"_{joint}" in left] == ["3"]
    assert [joint for joint in "35" if f"_{joint}" in right] == ["5"]


def test_a_moving_base_is_refused() -> None:
    link = '<inertial pos=".1 0 0" mass="1" diaginertia=".01 .01 .01"/>'
    leg = f'<body><joint name="hip"/>{link}</body>'
    xml = f'<mujoco><worldbody><body><freejoint name="root"/>{link}{leg}</body></worldbody></mujoco>'
    with pytest.raises(
        InputError, match="root: .* fixed base, got free, a moving base; hold the trunk"
    ) as caught:
        chain_from_model(mujoco.MjModel.from_xml_string(xml))
    assert "\n" not in str(caught.value)
