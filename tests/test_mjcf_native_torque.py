"""Native MJCF forms of friction and transmission: the torque that plain MuJoCo adds, against the law."""

from collections.abc import Callable
from pathlib import Path

import mujoco
import numpy as np
import pytest

from testbench.effects import injection
from testbench.effects.mjcf_form import effects_spec
from testbench.robot import Robot, load_robot

from .closed_form_arm import J, on_joint
from .simulated_arm import robot_from
from .simulated_effects import ARM


@pytest.fixture(scope="module")
def arm(tmp_path_factory: pytest.TempPathFactory) -> Robot:
    return robot_from(ARM, tmp_path_factory.mktemp("arm"))


def states() -> list[tuple[np.ndarray, np.ndarray]]:
    rng = np.random.default_rng(1)
    return [(rng.uniform(-1, 1, 3), rng.uniform(-2, 2, 3)) for _ in range(20)]


def joint_torque(model: mujoco.MjModel, q: np.ndarray, dq: np.ndarray) -> np.ndarray:
    """Passive and actuator torque (3,) at zero control."""
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:] = q, dq
    mujoco.mj_forward(model, data)
    return np.array(data.qfrc_passive + data.qfrc_actuator)


@pytest.mark.parametrize(
    ("name", "values", "law"),
    [
        ("gravity_spring", {"stiffness": 6, "phase": 0.4}, lambda q, v: 6 * np.sin(0.4 - q)),
        ("cable_spring", {"stiffness": 2, "rest": -0.3}, lambda q, v: -2 * (q + 0.3)),
        (
            "transmission_ripple",
            {"amplitude": 1.5, "cycles": 12, "phase": 0.3},
            lambda q, v: -1.5 * np.sin(12 * q + 0.3),
        ),
        ("asymmetric_friction", {"offset": 0.4, "viscous_difference": 0}, lambda q, v: -0.4),
        ("nonlinear_viscous_friction", {"coefficient": 0.7, "exponent": 2}, lambda q, v: -0.7 * v * abs(v)),
    ],
)
def test_native_torque_is_the_law(
    arm: Robot, name: str, values: dict[str, float], law: Callable[[float, float], float]
) -> None:
    spec, sentences = effects_spec(arm, [injection(arm, name, 2, values)])
    written, plain = spec.compile(), mujoco.MjModel.from_xml_string(ARM)
    assert sentences == ()
    for q, dq in states():
        added = joint_torque(written, q, dq) - joint_torque(plain, q, dq)
        np.testing.assert_allclose(added, on_joint(np.array([law(q[J], dq[J])]))[0], atol=1e-9)


def test_a_native_gas_spring_is_a_sum_of_sines(arm: Robot) -> None:
    gas = injection(arm, "gravity_spring", 2, {"stiffness": 6, "phase": 0.4}, "gas_spring")
    spec, sentences = effects_spec(arm, [gas])
    written, plain = spec.compile(), mujoco.MjModel.from_xml_string(ARM)
    assert len(sentences) == 1
    angles = np.array([0.4 - q[J] for q, _ in states()])
    wanted = 6 * 0.5 * np.sin(angles) / np.sqrt(1.25 - np.cos(angles))
    added = np.array([(joint_torque(written, *at) - joint_torque(plain, *at))[J] for at in states()])
    # The overtones that are left out: .0034, .0016, ... of the stiffness and so on, added up.
    np.testing.assert_allclose(added, wanted, atol=6 * 0.015)


def test_native_coupling_damps_the_summed_speed(arm: Robot) -> None:
    spec, _ = effects_spec(
        arm, [injection(arm, "joint_coupling", 2, {"viscous": 0.6, "coulomb": 0}, None, 3)]
    )
    written, plain = spec.compile(), mujoco.MjModel.from_xml_string(ARM)
    for q, dq in states():
        added = joint_torque(written, q, dq) - joint_torque(plain, q, dq)
        shared = -0.6 * (dq[1] + dq[2])
        np.testing.assert_allclose(added, [0, shared, shared], atol=1e-9)


def free_swing(spec: mujoco.MjSpec, torque: float, seconds: float = 3.0) -> tuple[np.ndarray, np.ndarray]:
    """Positions (N, joints) of a wheel's joints under a constant torque on the first, and the time step."""
    spec.option.timestep = 2e-4
    model = spec.compile()
    data = mujoco.MjData(model)
    data.qfrc_applied[0] = torque
    out = []
    for _ in range(round(seconds / 2e-4)):
        mujoco.mj_step(model, data)
        out.append(data.qpos.copy())
    return np.array(out), np.array(model.opt.timestep)


FREE_WHEEL = """
<mujoco model="wheel"><worldbody><body><inertial pos="0 0 0" mass="1" diaginertia="1 1 0.4"/>
  <joint name="hinge" axis="0 0 1" armature="0.2" actuatorfrcrange="-60 60"/></body></worldbody></mujoco>
"""


def test_native_elasticity_swings_at_the_two_mass_frequency(tmp_path: Path) -> None:
    wheel = robot_from(FREE_WHEEL, tmp_path)
    stiffness = 2000.0
    elastic = injection(wheel, "joint_elasticity", 1, {"stiffness": stiffness, "damping": 0})
    spec, sentences = effects_spec(wheel, [elastic])
    positions, _ = free_swing(spec, 1.0)
    assert sentences == ()
    frequency = np.sqrt(stiffness * (1 / 0.2 + 1 / 0.4)) / (2 * np.pi)
    windup = positions[:, 1] - positions[:, 1].mean()
    crossings = np.flatnonzero(np.diff(np.sign(windup)) > 0)
    measured = (len(crossings) - 1) / (2e-4 * (crossings[-1] - crossings[0]))
    assert measured == pytest.approx(frequency, rel=0.01)


def test_native_backlash_keeps_the_link_within_the_gap(tmp_path: Path) -> None:
    wheel = robot_from(FREE_WHEEL, tmp_path)
    spec, sentences = effects_spec(wheel, [injection(wheel, "backlash", 1, {"gap": 0.02})])
    positions, _ = free_swing(spec, 1.0, 1.0)
    assert len(sentences) == 1
    # The motor pushes the link ahead of it: the link lags by half the gap, and by little more.
    assert positions[-500:, 1] == pytest.approx(-0.01, abs=1e-3)


@pytest.mark.parametrize("name", ["presliding_hysteresis", "stribeck_friction"])
def test_native_bristles_slide_at_the_level_of_the_law(arm: Robot, name: str) -> None:
    values = {"stiffness": 2000.0} if name == "presliding_hysteresis" else {}
    values = values or {"extra": 1.0, "velocity": 0.3, "exponent": 2.0}
    spec, sentences = effects_spec(arm, [injection(arm, name, 2, values)])
    spec.option.timestep = 2e-4
    spec.option.gravity = [0, 0, 0]
    model = spec.compile()
    data = mujoco.MjData(model)
    for _ in range(3000):
        # Dragged at a steady speed, so that the bristles have slid through.
        data.qvel[:] = [0, 0.4, 0]
        data.qpos[:] = 0
        mujoco.mj_step(model, data)
    data.qvel[:], data.qpos[:] = [0, 0.4, 0], 0
    mujoco.mj_forward(model, data)
    wanted = 2 + (np.exp(-((0.4 / 0.3) ** 2)) if name == "stribeck_friction" else 0)
    assert sentences == ()
    assert -data.qfrc_actuator[1] - data.qfrc_passive[1] - 3 * 0.4 == pytest.approx(wanted, rel=0.02)


@pytest.mark.parametrize("name", ["load_dependent_friction", "thermal_friction_drift"])
def test_what_has_no_form_in_mjcf_is_said(arm: Robot, name: str) -> None:
    spec, sentences = effects_spec(arm, [injection(arm, name, 2)])
    assert len(sentences) == 1
    assert spec.compile().nv == 3


def test_a_written_model_is_read_back(arm: Robot, tmp_path: Path) -> None:
    # What has springs as well is a simulator, and no model.
    together = [injection(arm, "backlash", joint) for joint in (1, 2)]
    spec, _ = effects_spec(arm, together)
    spec.compile()
    (tmp_path / "robot.xml").write_text(spec.to_xml())
    assert load_robot(tmp_path / "robot.xml").joints == 5
