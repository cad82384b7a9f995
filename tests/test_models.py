"""The shipped robots: their kinematics, their truth, and what their geoms are good for."""

from pathlib import Path

import mujoco
import numpy as np
import pytest

from identification.base_parameters import base_parameters
from identification.parameters import (
    ARMATURE,
    COULOMB,
    DEFAULT_GROUPS,
    INERTIAL,
    PER_JOINT,
    VISCOUS,
    inertial_parameters,
    pseudo_inertia,
)
from identification.regressor import regressor
from testbench.jobs.parity import mujoco_torques, pinocchio_model, pinocchio_torques
from testbench.robot import Robot, load_robot

MODELS = Path(__file__).parents[1] / "models"
EXTERIOR_GROUP, COLLISION_GROUP = 2, 3
PRIMITIVES = {
    int(kind)
    for kind in (
        mujoco.mjtGeom.mjGEOM_SPHERE,
        mujoco.mjtGeom.mjGEOM_CAPSULE,
        mujoco.mjtGeom.mjGEOM_CYLINDER,
        mujoco.mjtGeom.mjGEOM_BOX,
    )
}


@pytest.fixture(scope="module")
def tx90() -> Robot:
    return load_robot(MODELS / "tx90.xml")


@pytest.fixture(scope="module")
def rail_arm() -> Robot:
    return load_robot(MODELS / "rail_arm.xml")


@pytest.fixture(scope="module", params=["tx90", "rail_arm"])
def robot(request: pytest.FixtureRequest) -> Robot:
    return request.getfixturevalue(request.param)


def random_poses(robot: Robot, count: int, seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return rng.uniform(robot.limits.lower, robot.limits.upper, (count, robot.joints))


def random_states(robot: Robot, count: int, seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng([seed, 1])
    dq, ddq = rng.uniform(-1, 1, (2, count, robot.joints))
    return random_poses(robot, count, seed), dq * robot.limits.velocity, ddq * robot.limits.acceleration


def contacts(robot: Robot, q: np.ndarray) -> set[frozenset[str]]:
    """Names of the geom pairs that touch at a pose."""
    model, data = robot.model, mujoco.MjData(robot.model)
    data.qpos[:] = q
    mujoco.mj_forward(model, data)
    return {frozenset(model.geom(geom).name for geom in contact.geom) for contact in data.contact}


def collision_pairs(model: mujoco.MjModel) -> list[tuple[int, int]]:
    return list(zip(model.pair_geom1.tolist(), model.pair_geom2.tolist(), strict=True))


def gravity_torque(robot: Robot, q: np.ndarray) -> np.ndarray:
    columns = np.concatenate([PER_JOINT * j + np.arange(INERTIAL) for j in range(robot.joints)])
    rest = np.zeros_like(q)
    return regressor(robot.chain, q, rest, rest, columns) @ robot.parameters[columns]


def joint_inertia(robot: Robot, q: np.ndarray) -> np.ndarray:
    """Diagonal of the mass matrix, armature included, (N, n) kg·m²."""
    rest = np.zeros_like(q)
    out = np.empty_like(q)
    static = regressor(robot.chain, q, rest, rest) @ robot.parameters
    for joint in range(robot.joints):
        unit = rest.copy()
        unit[:, joint] = 1.0
        out[:, joint] = (regressor(robot.chain, q, rest, unit) @ robot.parameters - static)[:, joint]
    return out


def test_every_body_is_physically_consistent(robot: Robot) -> None:
    model = robot.model
    for body in range(1, model.nbody):
        flat = np.empty(9)
        mujoco.mju_quat2Mat(flat, model.body_iquat[body])
        axes = flat.reshape(3, 3)
        inertia = axes @ np.diag(model.body_inertia[body]) @ axes.T
        inertial = inertial_parameters(float(model.body_mass[body]), model.body_ipos[body], inertia)
        assert np.linalg.eigvalsh(pseudo_inertia(inertial)).min() > 0, model.body(body).name


def test_no_link_is_symmetric(robot: Robot) -> None:
    """Products of inertia, off-axis centres and every drive-side truth are there to be identified."""
    standard = robot.parameters.reshape(robot.joints, PER_JOINT)
    assert np.all(standard[:, [1, 2, 4, 6, 7, 8]] != 0)
    assert np.all(standard[:, [ARMATURE, VISCOUS, COULOMB]] > 0)


def test_regressor_mujoco_and_pinocchio_agree(robot: Robot) -> None:
    q, dq, ddq = random_states(robot, 1000, seed=1)
    standard = robot.parameters.reshape(robot.joints, PER_JOINT)
    coulomb = standard[:, COULOMB] * np.sign(dq)
    by_mujoco = mujoco_torques(mujoco.MjModel.from_xml_path(str(robot.path)), q, dq, ddq) + coulomb
    rigid = pinocchio_torques(pinocchio_model(robot), robot.joint_names, q, dq, ddq)
    by_pinocchio = rigid + standard[:, VISCOUS] * dq + coulomb
    by_regressor = regressor(robot.chain, q, dq, ddq) @ robot.parameters
    np.testing.assert_allclose(by_regressor, by_mujoco, rtol=0, atol=1e-9)
    np.testing.assert_allclose(by_pinocchio, by_mujoco, rtol=0, atol=1e-9)


def test_every_limit_is_finite_and_agrees_with_the_motor(robot: Robot) -> None:
    limits = robot.limits
    for values in (limits.lower, limits.upper, limits.velocity, limits.acceleration, limits.torque):
        assert values.shape == (robot.joints,)
        assert np.all(np.isfinite(values))
    np.testing.assert_array_equal(robot.model.jnt_actfrcrange[:, 1], limits.torque)
    np.testing.assert_array_equal(robot.model.actuator_ctrlrange[:, 1], limits.torque)
    np.testing.assert_array_equal(robot.model.actuator_trnid[:, 0], np.arange(robot.joints))


def test_the_motors_can_hold_and_move_the_arm(robot: Robot) -> None:
    """Gravity takes at most half of a limit; a typical fast motion stays within it on every joint."""
    q, dq, ddq = random_states(robot, 1000, seed=2)
    assert np.all(np.abs(gravity_torque(robot, q)).max(axis=0) < 0.5 * robot.limits.torque)
    torque = regressor(robot.chain, q, dq, ddq) @ robot.parameters
    assert np.all(np.sqrt(np.mean(torque**2, axis=0)) < 0.6 * robot.limits.torque)


def test_exterior_and_collision_geoms_are_named_primitives_that_only_pairs_collide(robot: Robot) -> None:
    model = robot.model
    assert model.nmesh == 0
    assert not model.geom_contype.any()
    assert not model.geom_conaffinity.any()
    for geom in range(model.ngeom):
        name, body = model.geom(geom).name, int(model.geom_bodyid[geom])
        if name == "floor":
            continue
        assert body > 0
        assert int(model.geom_type[geom]) in PRIMITIVES
        assert model.geom_group[geom] == (
            COLLISION_GROUP if name.startswith("collision_") else EXTERIOR_GROUP
        )
    for group in (EXTERIOR_GROUP, COLLISION_GROUP):
        assert set(model.geom_bodyid[model.geom_group == group]) == set(range(1, model.nbody))


def test_pairs_join_collision_geoms_of_non_adjacent_links_and_the_floor(robot: Robot) -> None:
    model = robot.model
    paired = set()
    for pair in collision_pairs(model):
        names = {model.geom(geom).name for geom in pair}
        paired |= names
        if "floor" not in names:
            first, second = sorted(int(model.geom_bodyid[geom]) for geom in pair)
            assert second - first >= 2, names
    collision = {model.geom(g).name for g in np.flatnonzero(model.geom_group == COLLISION_GROUP)}
    assert paired == collision | {"floor"}


def test_the_zero_pose_is_clear_by_two_centimetres(robot: Robot) -> None:
    model, data = robot.model, mujoco.MjData(robot.model)
    mujoco.mj_forward(model, data)
    assert data.ncon == 0
    clearance = [mujoco.mj_geomDistance(model, data, *pair, 1.0, None) for pair in collision_pairs(model)]
    assert min(clearance) > 0.02


def test_some_random_poses_touch_the_robot_or_the_floor_and_most_do_not(robot: Robot) -> None:
    touching = [contacts(robot, q) for q in random_poses(robot, 500, seed=3)]
    assert 0.03 < np.mean([bool(pairs) for pairs in touching]) < 0.4
    assert any("floor" in pair for pairs in touching for pair in pairs)
    assert any("floor" not in pair for pairs in touching for pair in pairs)


def modified_dh(a: float, alpha: float, d: float, theta: float) -> np.ndarray:
    """Craig's link transform, parent to link."""
    ca, sa, ct, st = np.cos(alpha), np.sin(alpha), np.cos(theta), np.sin(theta)
    return np.array(
        [
            [ct, -st, 0, a],
            [st * ca, ct * ca, -sa, -sa * d],
            [st * sa, ct * sa, ca, ca * d],
            [0, 0, 0, 1],
        ]
    )


def test_tx90_frames_are_its_modified_dh_frames(tx90: Robot) -> None:
    right = np.pi / 2
    table = [
        (0, 0, 0.478, 0),
        (0.050, -right, 0, -right),
        (0.425, 0, 0.050, right),
        (0, right, 0.425, 0),
        (0, -right, 0, 0),
        (0, right, 0.100, 0),
    ]
    model, data = tx90.model, mujoco.MjData(tx90.model)
    assert not model.jnt_pos.any()
    np.testing.assert_array_equal(model.jnt_axis, np.tile([0, 0, 1], (6, 1)))
    for q in random_poses(tx90, 200, seed=4):
        data.qpos[:] = q
        mujoco.mj_kinematics(model, data)
        frame = np.eye(4)
        for joint, (a, alpha, d, offset) in enumerate(table):
            frame = frame @ modified_dh(a, alpha, d, q[joint] + offset)
            link = data.body(f"link_{joint + 1}")
            np.testing.assert_allclose(link.xpos, frame[:3, 3], rtol=0, atol=1e-12)
            np.testing.assert_allclose(link.xmat.reshape(3, 3), frame[:3, :3], rtol=0, atol=1e-12)
        np.testing.assert_allclose(data.site("tool0").xpos, frame[:3, 3], rtol=0, atol=1e-12)


def test_tx90_limits_are_the_makers_and_the_peak_torques(tx90: Robot) -> None:
    limits = tx90.limits
    np.testing.assert_allclose(np.rad2deg(limits.lower), [-180, -130, -145, -270, -115, -270], atol=1e-9)
    np.testing.assert_allclose(np.rad2deg(limits.upper), [180, 147.5, 145, 270, 140, 270], atol=1e-9)
    np.testing.assert_allclose(np.rad2deg(limits.velocity), [400, 400, 430, 540, 475, 760], atol=1e-4)
    np.testing.assert_array_equal(limits.torque, [700, 700, 250, 70, 45, 25])


def test_tx90_has_the_known_numbers_of_base_parameters(tx90: Robot) -> None:
    groups = [("inertial",), ("inertial", "armature"), DEFAULT_GROUPS]
    assert [base_parameters(tx90.chain, group).count for group in groups] == [36, 40, 52]


def test_tx90_gravity_matches_the_real_arm(tx90: Robot) -> None:
    """About 172 sin q2 + 44 sin(q2 + q3) N·m pull at J2, 44 at J3, 1 at the wrist, none at J1."""
    q = random_poses(tx90, 500, seed=5)
    holding = gravity_torque(tx90, q)
    arm, forearm = q[:, 1], q[:, 1] + q[:, 2]
    basis = np.column_stack([np.sin(arm), np.sin(forearm), np.cos(arm), np.cos(forearm)])
    at_2, at_3 = np.linalg.lstsq(basis, holding[:, 1:3], rcond=None)[0].T
    np.testing.assert_allclose(at_2, [-172, -44, 0, 0], atol=2)
    np.testing.assert_allclose(at_3, [0, -44, 0, 0], atol=2)
    np.testing.assert_allclose(holding[:, 0], 0, atol=1e-9)
    assert 0.5 < np.abs(holding[:, 4]).max() < 1.5


def test_tx90_inertia_and_friction_match_the_real_arm(tx90: Robot) -> None:
    """Within 5 % of the identified ranges; viscous friction is half of its slow-motion values."""
    inertia = joint_inertia(tx90, random_poses(tx90, 500, seed=6))
    least, most = np.array([8.8, 17, 3.0, 0.50, 0.075, 0.087]), np.array([23, 23, 3.4, 0.64, 0.16, 0.087])
    assert np.all(inertia.min(axis=0) > 0.95 * least)
    assert np.all(inertia.max(axis=0) < 1.05 * most)
    standard = tx90.parameters.reshape(6, PER_JOINT)
    np.testing.assert_allclose(standard[:, VISCOUS], 0.5 * np.array([57, 50, 11.5, 6.9, 3.5, 2.0]))
    np.testing.assert_allclose(standard[:, COULOMB], [29, 32, 12.5, 5.5, 3.4, 1.9])


def test_rail_arm_is_the_general_case(rail_arm: Robot) -> None:
    """A slide first, axes along body x, y and z, and a joint away from its body's origin."""
    model = rail_arm.model
    assert rail_arm.chain.is_slide.tolist() == [True] + 7 * [False]
    assert rail_arm.units() == ("N", *(7 * ("N·m",)))
    assert set(np.argmax(np.abs(model.jnt_axis), axis=1)) == {0, 1, 2}
    assert np.count_nonzero(model.jnt_pos.any(axis=1)) == 1
    assert rail_arm.limits.upper[0] - rail_arm.limits.lower[0] == 2.0
