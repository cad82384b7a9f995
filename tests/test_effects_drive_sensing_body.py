"""Effects of drive, sensing and body: simulation against their laws, signatures against changed torques."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.signal import lsim

from identification.base_parameters import base_parameters
from identification.chain import chain_from_model
from identification.errors import InputError
from identification.excitation.fourier import FourierSeries
from identification.filtering import decimation_step, edge_samples, zero_phase_lowpass
from identification.inverse_dynamics import inverse_dynamics
from identification.regressor import regressor
from testbench.effects import effect, injection
from testbench.effects.action import BUS_ROWS, COMMAND, DRIVE, STEP, TIMESTEP, SimulatedRobot
from testbench.effects.base import Injection
from testbench.effects.external_contact import push_point
from testbench.effects.logged import Logged, body_in_link, logged_run
from testbench.effects.signature import Family, amplitude_and_phase
from testbench.log import Recording
from testbench.robot import Robot, load_robot
from testbench.simulation import SimulationOptions, sample_reference, simulate

RATE, STEP_SIZE, CUTOFF = 1000.0, 2e-4, 20.0
NAMES = (
    "torque_gain_error",
    "torque_delay",
    "actuator_lag",
    "torque_saturation",
    "encoder_offset",
    "encoder_eccentricity",
    "payload",
    "base_tilt",
    "external_contact",
)


@pytest.fixture(scope="module")
def arm(models):
    return load_robot(models / "tx90.xml")


@pytest.fixture(scope="module")
def motion() -> FourierSeries:
    """A motion of every joint, fast enough for torques of the size the drives have; 2.5 s."""
    rng = np.random.default_rng(4)
    a, b = rng.normal(size=(2, 6, 4))
    a[:, 0] -= a.sum(axis=1)
    b[:, 0] -= b @ np.arange(1, 5)
    series = FourierSeries(0.4, np.array([0.3, 0.5, 0.8, 0.2, 0.6, -0.4]), a, b)
    _, speed, _ = series.evaluate(np.linspace(0, 2.5, 500))
    return series.scaled(np.array([1.5, 1.3, 1.8, 3.0, 3.0, 4.0]) / np.abs(speed).max(axis=0))


INJECTED = {
    "healthy": None,
    "gain": ("torque_gain_error", 2, {"relative": 0.08}, None),
    "delay": ("torque_delay", None, {"delay": 0.004}, None),
    "lag": ("actuator_lag", 2, {"time_constant": 0.006}, "first_order"),
    "second_order_lag": ("actuator_lag", 2, {"time_constant": 0.006}, "second_order"),
    "clip": ("torque_saturation", 2, {"limit": 150.0}, "clip"),
    "offset": ("encoder_offset", 3, {"offset": 0.02}, None),
    "eccentricity": ("encoder_eccentricity", 4, {"amplitude": 0.01, "phase": 0.7}, None),
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


@pytest.fixture(scope="module")
def recordings(arm, motion) -> dict[str, Recording]:
    options = []
    for each in INJECTED.values():
        effects = () if each is None else (injection(arm, *each),)
        options.append(SimulationOptions(physics_timestep=STEP_SIZE, effects=effects))
    reference = sample_reference(motion, RATE)
    runs = simulate(arm, [reference] * len(options), options, nominal=arm)
    return dict(zip(INJECTED, runs, strict=True))


def rms(x: np.ndarray) -> float:
    return float(np.sqrt(np.mean(x**2)))


def driven(arm: Robot, name: str, joint: int, values: dict[str, float], law: str, command: np.ndarray):
    """The drive torque (N,) that an effect makes of a command (N,), a value a physics step."""
    simulated = SimulatedRobot(arm, STEP_SIZE, RATE, np.ones(arm.joints))
    acting = effect(name).action(Injection(name, joint, values, law), simulated)
    bus, out = np.zeros((arm.joints, BUS_ROWS)), []
    for step, torque in enumerate(command):
        bus[:, STEP], bus[:, TIMESTEP] = step, STEP_SIZE
        bus[:, COMMAND] = bus[:, DRIVE] = torque
        for each in acting.hooks:
            each.kernel(bus, each.parameters, each.state, each.joint)
        out.append(bus[joint or 0, DRIVE])
    return np.array(out)


# The drive, step by step


@pytest.mark.parametrize("delay", [0.0, 0.0008, 0.00111])
def test_a_delay_shifts_a_ramp_by_itself(arm, delay):
    ramp = 5.0 * STEP_SIZE * np.arange(200)
    out = driven(arm, "torque_delay", None, {"delay": delay}, "default", ramp)
    np.testing.assert_allclose(out[50:], ramp[50:] - 5.0 * delay, atol=1e-12)


@pytest.mark.parametrize("law", ["first_order", "second_order"])
def test_a_lag_answers_as_its_transfer_function(arm, law):
    time_constant, rng = 0.003, np.random.default_rng(0)
    command = np.repeat(rng.normal(size=60), 5)
    out = driven(arm, "actuator_lag", 1, {"time_constant": time_constant}, law, command)
    fine = 50
    time = np.arange(len(command) * fine) * STEP_SIZE / fine
    half = time_constant / 2
    denominator = [time_constant, 1] if law == "first_order" else [half**2, 2 * half, 1]
    start = [[time_constant * command[0]], [4 * half**2 * command[0]]]
    states = start[0] if law == "first_order" else [0.0, half**2 * command[0]]
    _, response, _ = lsim(([1.0], denominator), np.repeat(command, fine), time, states, interp=False)
    means = response.reshape(-1, fine).mean(axis=1)
    # The reference's mean is a Riemann sum on a grid fifty times as fine.
    np.testing.assert_allclose(out, means, atol=2e-3 * np.abs(command).max())


def test_the_soft_limit_is_kept_and_leaves_small_torques_alone(arm):
    command = np.array([-500.0, -20.0, 0.0, 20.0, 500.0])
    out = driven(arm, "torque_saturation", 1, {"limit": 100.0}, "soft", command)
    np.testing.assert_allclose(out[[0, -1]], [-100.0, 100.0], rtol=1e-5)
    np.testing.assert_allclose(out[1:4], command[1:4], rtol=1e-6)


# The drive and the encoder in closed loop


def held_mean(x: np.ndarray) -> np.ndarray:
    return 0.5 * (x[:-1] + x[1:])


def test_the_drive_reports_what_it_was_asked_and_gives_what_the_law_says(recordings):
    command = {name: run.torque_command for name, run in recordings.items()}
    gain = recordings["gain"].truth["torque"][1:, 1]
    np.testing.assert_allclose(gain, 1.08 * held_mean(command["gain"][:, 1]), rtol=1e-12)
    clipped = recordings["clip"].truth["torque"][1:, 1]
    np.testing.assert_allclose(clipped, held_mean(np.clip(command["clip"][:, 1], -150, 150)), rtol=1e-12)
    assert np.abs(command["clip"][:, 1]).max() > 200
    delayed = recordings["delay"].truth["torque"][5:]
    np.testing.assert_allclose(delayed, held_mean(command["delay"])[:-4], rtol=1e-12)
    for name in ("gain", "clip", "delay"):
        reported = recordings[name].torque
        np.testing.assert_allclose(reported[1:], held_mean(command[name]), rtol=1e-12)


@pytest.mark.parametrize("name", ["lag", "second_order_lag"])
def test_a_lagging_drive_is_late_by_its_time_constant(recordings, name):
    run = recordings[name]
    asked, given = run.torque[:, 1], run.truth["torque"][:, 1]
    slope = np.gradient(given, 1 / RATE)
    slow = slice(100, None)
    late = np.sum((asked - given)[slow] * slope[slow]) / np.sum(slope[slow] ** 2)
    # Torque steps at reversals have more than the law's first-order term.
    assert late == pytest.approx(0.006, rel=0.2)


def test_the_encoder_reads_the_true_angle_and_its_error(recordings):
    run = recordings["offset"]
    error = run.position - run.truth["position"]
    np.testing.assert_allclose(error, np.broadcast_to([0, 0, 0.02, 0, 0, 0], error.shape), atol=1e-12)
    run = recordings["eccentricity"]
    error, q = run.position - run.truth["position"], run.truth["position"][:, 3]
    np.testing.assert_allclose(error[:, 3], 0.01 * np.sin(q + 0.7), atol=1e-12)
    assert not np.delete(error, 3, axis=1).any()


def test_eccentricity_is_refused_on_a_slide_joint(models):
    rail = load_robot(models / "rail_arm.xml")
    run = simulate_one(rail, injection(rail, "encoder_eccentricity", 1, {"amplitude": 0.01}))
    with pytest.raises(InputError, match="revolutions"):
        run()


def simulate_one(robot: Robot, each: Injection):
    still = np.zeros((3, robot.joints))
    reference = sample_reference(FourierSeries(1.0, still[0], still[:2].T, still[:2].T), RATE)
    return lambda: simulate(robot, [reference], SimulationOptions(effects=(each,)))


# Body and world, against models that MuJoCo compiles


def needed_torque(robot: Robot, spec: mujoco.MjSpec, run: Recording) -> np.ndarray:
    """What a model needs for the true motion, by mj_inverse, plus the true friction."""
    for joint in spec.joints:
        joint.damping, joint.frictionloss = [0, 0, 0], 0
    spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    model = spec.compile()
    data, out = mujoco.MjData(model), []
    truth = run.truth
    for q, dq, ddq in zip(truth["position"], truth["velocity"], truth["acceleration"], strict=True):
        data.qpos[:], data.qvel[:], data.qacc[:] = q, dq, ddq
        mujoco.mj_inverse(model, data)
        out.append(data.qfrc_inverse.copy())
    return np.array(out) + truth["friction_torque"]


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


def pushed(arm: Robot, run: Recording, in_world: bool) -> np.ndarray:
    """J' F (N, n) of a force of 8 N·m about joint 5, by MuJoCo's Jacobian along the true motion."""
    data = mujoco.MjData(arm.model)
    point, direction = push_point(arm.chain, 4)
    rotation, origin = body_in_link(arm, 4)
    local, push = rotation.T @ (point - origin), rotation.T @ direction * 8.0 / np.linalg.norm(point)
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


# Signatures along exact motions


@pytest.fixture(scope="module")
def exact(arm, motion) -> Logged:
    """A closed-form motion with the model's own torque."""
    time = np.arange(2500) / RATE
    q, dq, ddq = motion.evaluate(time)
    rotation, origin = body_in_link(arm, 5)
    return Logged(
        chain=arm.chain,
        parameters=arm.parameters,
        nominal=arm.parameters,
        limits=arm.limits,
        time=time,
        sample_rate=RATE,
        cutoff=20.0,
        q=q,
        dq=dq,
        ddq=ddq,
        tau=torque(arm, q, dq, ddq),
        body_rotation=rotation,
        body_origin=origin,
    )


def torque(arm: Robot, q: np.ndarray, dq: np.ndarray, ddq: np.ndarray) -> np.ndarray:
    return inverse_dynamics(arm.chain, arm.parameters, q, dq, ddq)


def filtered(x: np.ndarray) -> np.ndarray:
    """What identification makes of torque and regressor, (N, n, ...): low-passed, decimated, (K, ...)."""
    low = zero_phase_lowpass(x, RATE, CUTOFF)
    edge = edge_samples(RATE, CUTOFF)
    kept = low[edge : len(x) - edge : decimation_step(RATE, CUTOFF)]
    return kept.reshape(kept.shape[0] * kept.shape[1], -1)


def base_space(run: Logged) -> np.ndarray:
    """Orthonormal basis of what the base parameters can explain, (K, b)."""
    columns = base_parameters(run.chain, ("inertial", "armature", "viscous", "coulomb", "offset")).columns
    return np.linalg.qr(filtered(regressor(run.chain, run.q, run.dq, run.ddq, columns)))[0]


def explained(run: Logged, family: Family, change: np.ndarray, projected: bool = True) -> tuple[float, int]:
    """Largest share of a change of torque (N, n) that a member explains, and which member it is."""
    basis = base_space(run) if projected else None
    wanted = filtered(change)[:, 0]
    left = wanted if basis is None else wanted - basis @ (basis.T @ wanted)
    shares = []
    for member in family.members:
        columns = filtered(member.spread(0, run.joints))
        columns = columns if basis is None else columns - basis @ (basis.T @ columns)
        found = np.linalg.lstsq(columns, left, rcond=1e-9)[0]
        shares.append(1 - np.sum((left - columns @ found) ** 2) / np.sum(left**2))
    return max(shares), int(np.argmax(shares))


def fitted(run: Logged, family: Family, change: np.ndarray, index: int = 0):
    """The contract's parameters of a member fitted to a change of torque, without the base parameters."""
    member = family.members[index]
    c = np.linalg.lstsq(filtered(member.spread(0, run.joints)), filtered(change)[:, 0], rcond=1e-9)[0]
    return family.parameters(member, c, 1e-6 * np.eye(len(c) + len(member.shape)))


def test_the_gain_column_is_the_torque_over_the_gain(exact):
    family = effect("torque_gain_error").signature([exact], 1, None)
    change = np.zeros_like(exact.tau)
    change[:, 1] = exact.tau[:, 1] / 1.08 - exact.tau[:, 1]
    assert family.swallowed
    assert explained(exact, family, change, projected=False)[0] > 0.999
    assert fitted(exact, family, change)["relative"].value == pytest.approx(0.08, rel=1e-6)


def test_a_common_delay_is_explained(arm, motion, exact):
    delay = 0.003
    later = motion.evaluate(exact.time + delay)
    change = torque(arm, *later) - exact.tau
    family = effect("torque_delay").signature([exact], None, None)
    share, index = explained(exact, family, change)
    assert share > 0.9
    assert fitted(exact, family, change, index)["delay"].value == pytest.approx(delay, rel=0.15)


def test_a_lag_is_explained(arm, motion, exact):
    """reported = true + T d(true)/dt, with the derivative of the smooth part in closed form."""
    smooth = exact.predicted[:, 2] - arm.parameters.reshape(6, -1)[2, 12] * np.sign(exact.dq[:, 2])
    ends = [motion.evaluate(exact.time + shift) for shift in (-1e-6, 1e-6)]
    rates = [torque(arm, *end)[:, 2] for end in ends]
    smooth_rate = (rates[1] - rates[0]) / 2e-6
    reversal = np.abs(np.diff(np.sign(exact.dq[:, 2]), append=0)) > 0
    quiet = ~(reversal | np.roll(reversal, 1))
    change = np.zeros_like(exact.tau)
    change[quiet, 2] = 0.004 * smooth_rate[quiet]
    assert rms(smooth) > 1
    column = effect("actuator_lag").signature([exact], 2, None).members[0].columns[0][:, 0, 0]
    inner = quiet[2:-2]
    difference = column[2:-2][inner] * 0.004 - change[2:-2, 2][inner]
    assert rms(difference) < 0.1 * rms(change[:, 2])


def test_a_clipped_drive_is_explained(tmp_path):
    """One joint under a clipped torque, integrated by scipy; the log has the torque that was asked for."""
    (tmp_path / "one.xml").write_text(
        '<mujoco><worldbody><body><inertial pos=".3 0 0" mass="5" diaginertia=".1 .4 .4"/>'
        '<joint axis="0 1 0" armature=".5" damping="2"/></body></worldbody></mujoco>'
    )
    robot = load_robot(tmp_path / "one.xml")
    inertia = 0.4 + 5 * 0.3**2 + 0.5

    def asked(t, q, dq):
        return 40 * np.sin(3 * t) + 12 * np.sin(7 * t) + 60 * (0.5 * np.sin(3 * t) - q) - 8 * dq

    def move(t, y):
        drive = np.clip(asked(t, *y), -25, 25)
        # The axis points along +y: gravity turns a positive x arm with +y.
        return [y[1], (drive - 2 * y[1] + 5 * 0.3 * 9.81 * np.cos(y[0])) / inertia]

    time = np.arange(3000) / RATE
    solution = solve_ivp(move, (0, 3), [0.5, 0], t_eval=time, rtol=1e-8, atol=1e-8, max_step=5e-3)
    q, dq = solution.y[0][:, None], solution.y[1][:, None]
    ddq = np.array([move(t, y)[1] for t, y in zip(time, solution.y.T, strict=True)])[:, None]
    command = asked(time, q[:, 0], dq[:, 0])[:, None]
    true = np.clip(command, -25, 25)
    model = torque(robot, q, dq, ddq)
    np.testing.assert_allclose(model, true, atol=1e-6 * np.abs(true).max())
    run = Logged(
        robot.chain, robot.parameters, robot.parameters, robot.limits, time, RATE, 20.0, q, dq, ddq, command
    )
    family = effect("torque_saturation").signature([run], 0, None)
    share, _ = explained(run, family, command - true)
    assert share > 0.7
    best = family.member({"limit": 25.0})
    np.testing.assert_allclose(best.columns[0][:, 0, 0], (command - true)[:, 0], atol=1e-12)


def test_an_encoder_offset_is_explained(arm, exact):
    change = torque(arm, exact.q - 0.02 * np.eye(6)[2], exact.dq, exact.ddq) - exact.tau
    family = effect("encoder_offset").signature([exact], 2, None)
    assert explained(exact, family, change)[0] > 0.9
    assert fitted(exact, family, change)["offset"].value == pytest.approx(0.02, rel=0.05)


@pytest.mark.parametrize("joint", [1, 3])
def test_an_eccentric_encoder_is_explained(arm, exact, joint):
    amplitude, phase = 0.01, 0.7
    unit = np.eye(6)[joint]
    true = exact.q.copy()
    for _ in range(30):
        true = exact.q - amplitude * np.sin(true + phase) * unit
    angle = true[:, [joint]] + phase
    slope = 1 + amplitude * np.cos(angle)
    speed = exact.dq * (1 - unit) + exact.dq * unit / slope
    curve = amplitude * np.sin(angle) * speed[:, [joint]] ** 2 * unit
    acceleration = exact.ddq * (1 - unit) + (exact.ddq + curve) * unit / slope
    change = torque(arm, true, speed, acceleration) - exact.tau
    family = effect("encoder_eccentricity").signature([exact], joint, None)
    assert explained(exact, family, change)[0] > 0.9
    found = fitted(exact, family, change)
    assert found["amplitude"].value == pytest.approx(amplitude, rel=0.05)
    assert found["phase"].value == pytest.approx(phase, abs=0.05)


def test_a_payload_is_explained_and_told_in_the_bodys_frame(models):
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


def test_no_push_is_seen_in_a_healthy_residual(arm, recordings):
    run = logged_run(arm, recordings["healthy"], arm.parameters, 20.0)
    rng = np.random.default_rng(3)
    run = replace(run, tau=run.predicted + rng.normal(size=run.tau.shape))
    assert effect("external_contact").signature([run], 4, None).members == ()


# Behaviour common to all


def test_every_signature_fits_its_runs_and_two_of_them_together(exact):
    command = replace(exact, torque_command=exact.tau)
    for name in NAMES:
        joint = None if effect(name).DESCRIPTION.scope == "robot" else 3
        family = effect(name).signature([exact, command], joint, None)
        for member in family.members:
            assert [c.shape for c in member.columns] == [(exact.samples, len(member.rows), member.count)] * 2
            assert (member.lower <= member.upper).all()
            assert all(np.isfinite(columns).all() for columns in member.columns)


def test_amplitude_and_phase_have_first_order_deviations():
    covariance = np.array([[4e-4, 1e-4], [1e-4, 9e-4]])
    rng = np.random.default_rng(0)
    draws = rng.multivariate_normal([1.0, 2.0], covariance, 20000)
    sizes = np.hypot(draws[:, 0], draws[:, 1])
    phases = np.arctan2(draws[:, 0], draws[:, 1])
    amplitude, amplitude_std, phase, phase_std = amplitude_and_phase(1.0, 2.0, covariance)
    assert amplitude * np.sin(0.3 + phase) == pytest.approx(np.cos(0.3) + 2 * np.sin(0.3))
    # The deviation of 20000 draws is itself uncertain by half a per cent.
    assert amplitude_std == pytest.approx(sizes.std(), rel=0.03)
    assert phase_std == pytest.approx(phases.std(), rel=0.03)
