"""Signatures and MJCF forms of friction and transmission, against laws written here in closed form."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

from identification.filtering import zero_phase_lowpass
from identification.inverse_dynamics import inverse_dynamics
from identification.parameters import DEFAULT_GROUPS, group_columns
from identification.regressor import regressor
from testbench.effects import effects, injection
from testbench.effects.mjcf_form import effects_spec
from testbench.effects.signature import Family, Logged
from testbench.effects.transmission_ripple import periodogram_peaks
from testbench.robot import Robot, load_robot

from .test_effects_simulation import ARM, robot_from

RATE, CUTOFF = 500.0, 40.0
TIME = np.arange(6000) / RATE
FINENESS = 10
FINE_STEP = 1 / (RATE * FINENESS)
FINE = np.arange(len(TIME) * FINENESS) * FINE_STEP
J, K = 1, 2  # the joint with the effect, and the other of a pair


@pytest.fixture(scope="module")
def arm(tmp_path_factory: pytest.TempPathFactory) -> Robot:
    return robot_from(ARM, tmp_path_factory.mktemp("arm"))


def motion() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """q, dq, ddq (N, 3) of sums of sines up to 3 Hz, in closed form."""
    q, dq, ddq = (np.zeros((len(TIME), 3)) for _ in range(3))
    rng = np.random.default_rng(4)
    for frequency in (0.11, 0.27, 0.53, 1.1, 2.1, 3.0):
        w = 2 * np.pi * frequency
        amplitude, phase = rng.uniform(0.3, 1.0, 3) / (1 + 2 * frequency**1.5), rng.uniform(0, 6, 3)
        angle = w * TIME[:, None] + phase
        q += amplitude * np.sin(angle)
        dq += amplitude * w * np.cos(angle)
        ddq -= amplitude * w**2 * np.sin(angle)
    return q, dq, ddq


Q, DQ, DDQ = motion()


@pytest.fixture(scope="module")
def logged(arm: Robot) -> Logged:
    tau = inverse_dynamics(arm.chain, arm.parameters, Q, DQ, DDQ)
    return Logged(
        chain=arm.chain,
        parameters=arm.parameters,
        nominal=arm.parameters,
        limits=arm.limits,
        time=TIME,
        sample_rate=RATE,
        cutoff=CUTOFF,
        q=Q,
        dq=DQ,
        ddq=DDQ,
        tau=tau,
        reference_position=Q,
        reference_velocity=DQ,
        reference_acceleration=DDQ,
    )


def filtered(columns: np.ndarray) -> np.ndarray:
    """Columns (N, n, k) as a fit sees them, stacked (M, k)."""
    low = zero_phase_lowpass(columns, RATE, CUTOFF / 2)[100:-100:5]
    return low.reshape(-1, columns.shape[2])


@pytest.fixture(scope="module")
def base(arm: Robot) -> np.ndarray:
    """Orthonormal basis of what standard parameters explain, without the offset, which effects have too."""
    columns = group_columns(3, DEFAULT_GROUPS)
    return np.linalg.qr(filtered(regressor(arm.chain, Q, DQ, DDQ, columns)))[0]


def unexplained(base: np.ndarray, torque: np.ndarray, family: Family) -> tuple[float, dict[str, float]]:
    """Share of a change of torque (N, n) that base regressor and the best member leave, by power.

    Also that member's parameters.
    """
    wanted = filtered(torque[:, :, None])[:, 0]
    wanted = wanted - base @ (base.T @ wanted)
    best: tuple[float, dict[str, float]] = (np.inf, {})
    for member in family.members:
        columns = filtered(member.spread(0, 3))
        columns = columns - base @ (base.T @ columns)
        c = np.linalg.lstsq(columns, wanted, rcond=1e-9)[0]
        c = np.clip(c, member.lower, member.upper)
        left = float(np.sum((wanted - columns @ c) ** 2) / np.sum(wanted**2))
        if left < best[0]:
            size = member.count + len(family.refine)
            found = family.parameters(member, c, 1e-6 * np.eye(size))
            best = (left, {name: float(each.value) for name, each in found.items()})
    return best


def on_joint(torque: np.ndarray, joint: int = J) -> np.ndarray:
    """(N, 3) with the torque on one joint."""
    return torque[:, None] * np.eye(3)[joint]


def test_stribeck_is_explained(arm: Robot, base: np.ndarray, logged: Logged) -> None:
    v = DQ[:, J]
    torque = on_joint(1.3 * np.exp(-((np.abs(v) / 0.2) ** 1.5)) * np.sign(v))
    left, found = unexplained(base, torque, effects()["stribeck_friction"].signature([logged], J, None))
    assert left < 0.1
    assert found["extra"] == pytest.approx(1.3, rel=0.3)


def test_asymmetric_friction_is_explained_exactly(arm: Robot, base: np.ndarray, logged: Logged) -> None:
    torque = on_joint(0.4 - 0.7 * np.abs(DQ[:, J]))
    left, found = unexplained(base, torque, effects()["asymmetric_friction"].signature([logged], J, None))
    assert left < 1e-9
    assert found["viscous_difference"] == pytest.approx(-0.7)


@pytest.mark.parametrize("exponent", [0.4, 0.6, 2.0])
def test_nonlinear_viscous_friction_is_explained(
    arm: Robot, base: np.ndarray, logged: Logged, exponent: float
) -> None:
    v = DQ[:, J]
    torque = on_joint(2.0 * np.abs(v) ** exponent * np.sign(v))
    family = effects()["nonlinear_viscous_friction"].signature([logged], J, None)
    assert unexplained(base, torque, family)[0] < 0.1


def test_load_friction_is_explained(arm: Robot, base: np.ndarray, logged: Logged) -> None:
    _, load, _ = link_side(arm, J)
    torque = on_joint(0.08 * np.abs(load) * np.sign(DQ[:, J]))
    left, found = unexplained(base, torque, effects()["load_dependent_friction"].signature([logged], J, None))
    assert left < 1e-9
    assert found["coefficient"] == pytest.approx(0.08)


@pytest.mark.parametrize("displacement", [0.0015, 0.006])
def test_presliding_is_explained(arm: Robot, base: np.ndarray, logged: Logged, displacement: float) -> None:
    v = DQ[:, J]
    stiffness = 2.0 / displacement
    z, fine = [0.0], np.interp(FINE, TIME, v).tolist()
    for speed in fine[1:]:
        z.append(z[-1] + FINE_STEP * (speed - stiffness * abs(speed) * z[-1] / 2.0))
    torque = on_joint(stiffness * np.array(z)[::FINENESS] - 2.0 * np.sign(v))
    left, found = unexplained(base, torque, effects()["presliding_hysteresis"].signature([logged], J, None))
    assert left < 0.1
    assert found["stiffness"] == pytest.approx(stiffness, rel=0.5)


def test_thermal_drift_is_explained(arm: Robot, base: np.ndarray, logged: Logged) -> None:
    v = DQ[:, J]
    rated_speed = 0.3 * 4.0
    heat = np.abs((3 * v + 2 * np.sign(v)) * v) / ((3 * rated_speed + 2) * rated_speed)
    warm = [0.0]
    for power in heat[1:].tolist():
        warm.append(warm[-1] + (power - warm[-1]) / (12.0 * RATE))
    torque = on_joint(-0.4 * 3 * np.array(warm) * v)
    family = effects()["thermal_friction_drift"].signature([logged], J, None)
    own = replace(family, members=(family.member({"time_constant": 12.0, "carried": 0.0}),))
    left, found = unexplained(base, torque, own)
    assert left < 0.01
    assert found["drop"] == pytest.approx(0.4, rel=0.05)


def test_only_rising_friction_is_flattened(logged: Logged) -> None:
    family = effects()["nonlinear_viscous_friction"].signature([logged], J, None)
    assert [m.lower[0] == 0 for m in family.members] == [m.shape["exponent"] < 1 for m in family.members]


def test_warmth_is_carried_from_run_to_run_or_not(logged: Logged) -> None:
    family = effects()["thermal_friction_drift"].signature([logged, logged], J, None)
    cold, warm = (family.member({"time_constant": 15.0, "carried": carried}) for carried in (0.0, 1.0))
    first, second = (columns[:, 0, 0] / DQ[:, J] for columns in warm.columns)
    assert second[0] == pytest.approx(first[-1], rel=1e-3)
    np.testing.assert_array_equal(cold.columns[0], cold.columns[1])
    np.testing.assert_array_equal(cold.columns[0], warm.columns[0])


def link_side(arm: Robot, joint: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Standard parameters without rotors and friction, the joint's load (N,) and its link's inertia (N,)."""
    table = arm.parameters.reshape(3, 14).copy()
    table[:, 10:] = 0
    links = table.ravel()
    load = inverse_dynamics(arm.chain, links, Q, DQ, DDQ)[:, joint]
    weightless = replace(arm.chain, gravity=np.zeros(3))
    inertia = inverse_dynamics(weightless, links, Q, 0 * Q, 0 * Q + np.eye(3)[joint])[:, joint]
    return links, load, inertia


def elastic_torque(arm: Robot, stiffness: float, damping: float) -> np.ndarray:
    """Change of motor torque (N, 3) by a spring at joint J behind the motor's motion Q.

    The motor leads the link by w; semi-implicit Euler for w, full dynamics of the displaced link.
    """
    links, load, inertia = link_side(arm, J)
    w, dw, path = load[0] / stiffness, 0.0, []
    fine = (np.interp(FINE, TIME, load).tolist(), np.interp(FINE, TIME, inertia).tolist())
    for wanted, own in zip(*fine, strict=True):
        ddw = (wanted - stiffness * w - damping * dw) / own
        dw += FINE_STEP * ddw
        w += FINE_STEP * dw
        path.append((w, dw, ddw))
    moved = np.array(path)[::FINENESS, :, None] * np.eye(3)[J]
    displaced = inverse_dynamics(arm.chain, links, Q - moved[:, 0], DQ - moved[:, 1], DDQ - moved[:, 2])
    return displaced - inverse_dynamics(arm.chain, links, Q, DQ, DDQ)


@pytest.mark.parametrize("frequency", [8, 12, 16])
def test_elasticity_is_explained(arm: Robot, base: np.ndarray, logged: Logged, frequency: float) -> None:
    inertia = 0.9  # about what joint J carries
    stiffness = (2 * np.pi * frequency) ** 2 * inertia
    torque = elastic_torque(arm, stiffness, 4.0)
    family = effects()["joint_elasticity"].signature([logged], J, None)
    assert unexplained(base, torque, family)[0] < 0.1
    assert family.member is not None
    exact = replace(family, members=(family.member({"stiffness": stiffness}),))
    left, found = unexplained(base, torque, exact)
    assert left < 0.02
    assert found["stiffness"] == pytest.approx(stiffness, rel=0.1)
    assert found["damping"] == pytest.approx(4.0, rel=0.5)


def test_a_link_without_inertia_keeps_its_columns_finite(logged: Logged) -> None:
    negative = logged.parameters.reshape(3, 14).copy()
    negative[:, :10] *= -1
    odd = replace(logged, parameters=negative.ravel())
    for name in ("joint_elasticity", "backlash"):
        for member in effects()[name].signature([odd], J, None).members:
            assert np.isfinite(member.columns[0]).all()


def test_backlash_is_explained(arm: Robot, base: np.ndarray, logged: Logged) -> None:
    # Joint 0 turns about the vertical: its load changes sign with the acceleration, and it has no gravity.
    gap, joint = 0.003, 0
    links, load, inertia = link_side(arm, joint)
    contact = (2 * np.pi * 60) ** 2 * 0.3
    damping = 2 * 0.3 * 2 * np.pi * 60 * 0.3

    # The motor leads the link by x; semi-implicit Euler in steps far below the contact's period.
    x, dx, path = gap / 2, 0.0, []
    fine = (np.interp(FINE, TIME, load).tolist(), np.interp(FINE, TIME, inertia).tolist())
    for wanted, own in zip(*fine, strict=True):
        deep = np.sign(x) * max(abs(x) - gap / 2, 0.0)
        s = contact * deep + damping * dx if deep else 0.0
        s = 0.0 if s * deep < 0 else s
        ddx = (wanted - s) / own
        dx += FINE_STEP * ddx
        x += FINE_STEP * dx
        path.append((x, dx, ddx))
    # The mean over a sample, as an impact is shorter.
    means = [
        np.convolve(each, np.full(FINENESS, 1 / FINENESS), mode="same") for each in zip(*path, strict=True)
    ]
    moved = np.array(means).T[::FINENESS, :, None] * np.eye(3)[joint]
    displaced = inverse_dynamics(arm.chain, links, Q - moved[:, 0], DQ - moved[:, 1], DDQ - moved[:, 2])
    torque = displaced - inverse_dynamics(arm.chain, links, Q, DQ, DDQ)
    family = effects()["backlash"].signature([logged], joint, None)
    left, found = unexplained(base, torque, family)
    assert left < 0.3
    assert found["gap"] == pytest.approx(gap, rel=0.5)


def test_a_link_that_never_leaves_its_wall_shows_no_backlash(logged: Logged) -> None:
    # Gravity holds joint J against one end all the time.
    still = replace(logged, q=0 * Q + 0.1, dq=0 * Q, ddq=0 * Q)
    for member in effects()["backlash"].signature([still], J, None).members:
        assert not member.columns[0].any()


def test_ripple_is_found_in_the_residual_and_explained(arm: Robot, base: np.ndarray, logged: Logged) -> None:
    ripple = on_joint(0.8 * np.sin(23.7 * Q[:, J] + 0.6))
    family = effects()["transmission_ripple"].signature([replace(logged, tau=logged.tau + ripple)], J, None)
    assert family.member is not None
    near = min((m.shape["cycles"] for m in family.members), key=lambda cycles: abs(cycles - 23.7))
    _, spacing = periodogram_peaks([logged], J)
    assert near == pytest.approx(23.7, abs=spacing)
    refined = replace(family, members=(*family.members, family.member({"cycles": 23.7})))
    assert unexplained(base, ripple, family)[0] < 0.3
    left, found = unexplained(base, ripple, refined)
    assert left < 1e-9
    assert found["amplitude"] == pytest.approx(0.8)
    assert found["phase"] == pytest.approx(0.6)


def test_coupling_is_explained(arm: Robot, base: np.ndarray, logged: Logged) -> None:
    speed = DQ[:, J] + DQ[:, K]
    # Which way the shaft was turned since the sample before; at the first it is relaxed.
    turned = np.sign(np.convolve(speed, [1, 1])[: len(speed)]) * (np.arange(len(speed)) > 0)
    shared = 0.6 * speed + 1.1 * turned
    family = effects()["joint_coupling"].signature([logged], J, K)
    # The stiffer the shared shaft, the nearer is its friction to the sign.
    stiff = replace(family, members=(family.member({"twist": 1e-9}),))
    left, found = unexplained(base, on_joint(shared, J) + on_joint(shared, K), stiff)
    assert left < 1e-9
    assert (found["viscous"], found["coulomb"]) == pytest.approx((0.6, 1.1))


def test_springs_are_explained(arm: Robot, base: np.ndarray, logged: Logged) -> None:
    # At the first joint, where no gravity hides a sine.
    q = Q[:, 0]
    left, found = unexplained(
        base, on_joint(-5 * np.sin(0.7 - q), 0), effects()["gravity_spring"].signature([logged], 0, None)
    )
    assert left < 1e-9
    assert (found["stiffness"], found["phase"]) == pytest.approx((5, 0.7))
    left, found = unexplained(
        base, on_joint(3 * (q + 0.2), 0), effects()["cable_spring"].signature([logged], 0, None)
    )
    assert left < 1e-9
    assert (found["stiffness"], found["rest"]) == pytest.approx((3, -0.2))


# MJCF forms: the torque that plain MuJoCo adds, against the law


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
    together = [injection(arm, name, 2) for name in ("joint_elasticity", "backlash", "stribeck_friction")]
    spec, _ = effects_spec(arm, together)
    spec.compile()
    (tmp_path / "robot.xml").write_text(spec.to_xml())
    assert load_robot(tmp_path / "robot.xml").joints == 5
