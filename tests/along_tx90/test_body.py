"""Effects of body and world: simulation against MuJoCo's models, signatures against changed torques."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from identification.chain import chain_from_model
from identification.inverse_dynamics import inverse_dynamics
from testbench.effects import effect
from testbench.effects.base import Injection
from testbench.effects.external_contact import pushes
from testbench.effects.link_force import push_point
from testbench.effects.logged import Logged, body_in_link, logged_run
from testbench.jobs.parity import mujoco_torques
from testbench.log import Recording
from testbench.robot import Robot, load_robot

from .moving_tx90 import RATE, explained, fitted, rms

INJECTED = {
    "healthy": (),
    "tilt": ("base_tilt", None, {"roll": 0.03, "pitch": -0.02}, None),
    "link_force": ("external_contact", 5, {"torque": 8.0, "start": 0.8, "duration": 0.6}, "link_force"),
    "world_force": ("external_contact", 5, {"torque": 8.0, "start": 0.8, "duration": 0.6}, "world_force"),
    "payload": (
        "payload",
        None,
        {"mass": 4.0, "first_moment_x": 0.1, "first_moment_y": -0.05, "first_moment_z": 0.4},
        "sphere",
    ),
}


# In closed loop


def needed_torque(robot: Robot, spec: mujoco.MjSpec, run: Recording) -> np.ndarray:
    """What a model needs for the true motion, by mj_inverse, plus the true friction."""
    for joint in spec.joints:
        joint.damping, joint.frictionloss = [0, 0, 0], 0
    truth = run.truth
    motion = (truth[name] for name in ("position", "velocity", "acceleration"))
    return mujoco_torques(spec.compile(), *motion) + truth["friction_torque"]


def test_a_payload_is_one_more_body(arm, recordings):
    spec = mujoco.MjSpec.from_file(str(arm.path))
    flange = spec.body("link_6")
    radius = (3 * 4.0 / (4 * np.pi * 2700)) ** (1 / 3)
    ball = 0.4 * 4.0 * radius**2
    flange.add_body(mass=4.0, ipos=[0.025, -0.0125, 0.1], inertia=[ball] * 3, explicitinertial=True)
    run = recordings["payload"]
    missing = run.truth["torque"] - needed_torque(arm, spec, run)
    effect_size = run.truth["torque"] - needed_torque(arm, mujoco.MjSpec.from_file(str(arm.path)), run)
    assert rms(effect_size) > 5
    # The motion is logged to first order in the physics step.
    assert rms(missing) < 0.01 * rms(effect_size)


def test_a_tilted_base_is_a_turned_first_body(arm, recordings):
    spec = mujoco.MjSpec.from_file(str(arm.path))
    roll, pitch = 0.03, -0.02
    about_x = np.array([np.cos(roll / 2), np.sin(roll / 2), 0, 0])
    about_y = np.array([np.cos(pitch / 2), 0, np.sin(pitch / 2), 0])
    turned = np.empty(4)
    mujoco.mju_mulQuat(turned, about_y, about_x)
    spec.body("base_link").quat = turned
    run = recordings["tilt"]
    missing = run.truth["torque"] - needed_torque(arm, spec, run)
    effect_size = run.truth["torque"] - needed_torque(arm, mujoco.MjSpec.from_file(str(arm.path)), run)
    assert rms(effect_size) > 1
    assert rms(missing) < 0.01 * rms(effect_size)


def test_a_payload_on_a_single_link_keeps_mujocos_shortcuts_out(tmp_path):
    (tmp_path / "one.xml").write_text(
        '<mujoco><worldbody><body><inertial pos="0 0 0" mass="2" diaginertia="1 1 1"/>'
        '<joint axis="0 0 1"/></body></worldbody></mujoco>'
    )
    robot = load_robot(tmp_path / "one.xml")
    values = {"mass": 3.0, "first_moment_x": 0.6, "first_moment_y": 0.0, "first_moment_z": 0.0}
    acting = effect("payload").action(Injection("payload", None, values, "point"), None)
    acting.change_plant(robot.model)
    data = mujoco.MjData(robot.model)
    data.qacc[0] = 1.0
    mujoco.mj_inverse(robot.model, data)
    assert data.qfrc_inverse[0] == pytest.approx(1.0 + 0.6**2 / 3.0)


def pushed(arm: Robot, run: Recording, in_world: bool, beside: tuple[float, ...] = (0, 0, 0)) -> np.ndarray:
    """J' F (N, n) of a force of 8 N·m about joint 5, by MuJoCo's Jacobian along the true motion.

    beside: m, how far from the end of the link the same force acts instead.
    """
    data = mujoco.MjData(arm.model)
    point, direction = push_point(arm.chain, 4)
    lever = np.linalg.norm(point)
    point = point + beside
    rotation, origin = body_in_link(arm, 4)
    local, push = rotation.T @ (point - origin), rotation.T @ direction * 8.0 / lever
    body = int(arm.model.jnt_bodyid[4])
    jacobian, out, kept = np.empty((3, 6)), np.zeros_like(run.position), None
    for k, q in enumerate(run.truth["position"]):
        since = min(k / RATE - 0.8, 1.4 - k / RATE)
        if since <= 0:
            continue
        data.qpos[:] = q
        mujoco.mj_kinematics(arm.model, data)
        mujoco.mj_comPos(arm.model, data)
        axes = data.xmat[body].reshape(3, 3)
        mujoco.mj_jac(arm.model, data, jacobian, None, data.xpos[body] + axes @ local, body)
        force = axes @ push
        kept = force if kept is None or not in_world else kept
        size = 0.5 - 0.5 * np.cos(np.pi * min(since / 0.1, 1.0))
        out[k] = jacobian.T @ kept * size
    return out


@pytest.mark.parametrize("law", ["link_force", "world_force"])
def test_a_push_reaches_every_joint_through_the_jacobian(arm, recordings, law):
    run = recordings[law]
    expected = pushed(arm, run, law == "world_force")
    healthy = mujoco.MjSpec.from_file(str(arm.path))
    seen = needed_torque(arm, healthy, run) - run.truth["torque"]
    # The axis of joint 4 passes through the wrist, where the push has no lever.
    assert np.abs(expected[:, [0, 1, 2, 4]]).max(axis=0).min() > 0.5
    assert not run.truth["effect_torque"][:790].any()
    assert rms(seen - expected) < 0.02 * rms(expected)
    if law == "link_force":
        assert np.abs(expected[:, 4]).max() == pytest.approx(8.0, rel=1e-9)


# Signatures


def test_a_payload_is_explained_and_reported_in_the_bodys_frame(models):
    """On the arm whose last body is turned against its link frame; MuJoCo compiles the loaded model."""
    rail = load_robot(models / "rail_arm.xml")
    spec = mujoco.MjSpec.from_file(str(rail.path))
    body = spec.body(rail.model.body(int(rail.model.jnt_bodyid[-1])).name)
    body.add_body(mass=2.0, ipos=[0.05, -0.03, 0.2], inertia=[0.01] * 3, explicitinertial=True)
    parameters = chain_from_model(spec.compile())[1]
    rng = np.random.default_rng(2)
    q, dq, ddq = rng.uniform(-1, 1, (3, 400, rail.joints))
    change = inverse_dynamics(rail.chain, parameters - rail.parameters, q, dq, ddq)
    rotation, origin = body_in_link(rail, rail.joints - 1)
    run = Logged(
        rail.chain, rail.parameters, rail.parameters, rail.limits, np.arange(400) / RATE, RATE, 20.0,
        q, dq, ddq, change, body_rotation=rotation, body_origin=origin,
    )  # fmt: skip
    family = effect("payload").signature([run], None, None)
    assert family.swallowed
    assert explained(run, family, change, projected=False)[0] > 0.999
    found = fitted(run, family, change)
    assert found["mass"].value == pytest.approx(2.0, rel=1e-6)
    np.testing.assert_allclose(found["first_moment"].value, [0.1, -0.06, 0.4], atol=1e-6)


def test_a_tilt_is_explained(arm, exact):
    tilted = replace(arm.chain, gravity=needed_gravity(0.04, -0.03))
    change = inverse_dynamics(tilted, arm.parameters, exact.q, exact.dq, exact.ddq) - exact.tau
    family = effect("base_tilt").signature([exact], None, None)
    assert explained(exact, family, change)[0] > 0.9
    found = fitted(exact, family, change)
    assert found["roll"].value == pytest.approx(0.04, rel=0.05)
    assert found["pitch"].value == pytest.approx(-0.03, rel=0.05)


def needed_gravity(roll: float, pitch: float) -> np.ndarray:
    """Gravity seen from a base turned about world x by roll and then about world y by pitch."""
    return 9.81 * np.array([np.sin(pitch), -np.cos(pitch) * np.sin(roll), -np.cos(pitch) * np.cos(roll)])


@pytest.mark.parametrize("law", ["link_force", "world_force"])
def test_a_push_is_found_in_time_and_explained(arm, recordings, law):
    run = logged_run(arm, recordings[law], arm.parameters, 20.0)
    change = -pushed(arm, recordings[law], law == "world_force")
    run = replace(run, tau=run.predicted + change)
    family = effect("external_contact").signature([run], 4, None)
    share, index = explained(run, family, change)
    assert share > 0.9
    found = fitted(run, family, change, index)
    assert abs(found["torque"].value) == pytest.approx(8.0, rel=0.15)
    assert found["intervals"].value == pytest.approx((0.8, 1.4), abs=0.15)


@pytest.mark.parametrize("law", ["link_force", "world_force"])
def test_a_push_at_any_point_of_a_link_is_explained_by_that_link_alone(arm, recordings, law):
    run = logged_run(arm, recordings[law], arm.parameters, 20.0)
    change = -pushed(arm, recordings[law], law == "world_force", beside=(0.05, -0.1, 0.2))
    run = replace(run, tau=run.predicted + change)
    when = [[(round(0.85 * RATE), round(1.35 * RATE))]]
    left = [1 - explained(run, pushes([run], link, when), change, projected=False)[0] for link in (3, 4, 5)]
    assert left[1] < 1e-3
    assert left[1] < 0.2 * min(left[0], left[2])


def test_no_push_is_seen_in_a_healthy_residual(arm, recordings):
    run = logged_run(arm, recordings["healthy"], arm.parameters, 20.0)
    rng = np.random.default_rng(3)
    run = replace(run, tau=run.predicted + rng.normal(size=run.tau.shape))
    assert effect("external_contact").signature([run], 4, None).members == ()
