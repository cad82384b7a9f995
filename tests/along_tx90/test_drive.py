"""Effects of the drive: simulation against their laws, signatures against changed torques."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.signal import lsim

from testbench.effects import effect
from testbench.effects.action import BUS_ROWS, COMMAND, DRIVE, STEP, TIMESTEP, SimulatedRobot
from testbench.effects.base import Injection
from testbench.effects.logged import Logged
from testbench.robot import Robot, load_robot

from .moving_tx90 import RATE, STEP_SIZE, explained, fitted, rms, torque

INJECTED = {
    "gain": ("torque_gain_error", 2, {"relative": 0.08}, None),
    "delay": ("torque_delay", None, {"delay": 0.004}, None),
    "lag": ("actuator_lag", 2, {"time_constant": 0.006}, "first_order"),
    "second_order_lag": ("actuator_lag", 2, {"time_constant": 0.006}, "second_order"),
    "clip": ("torque_saturation", 2, {"limit": 150.0}, "clip"),
}


def driven(arm: Robot, name: str, joint: int, values: dict[str, float], law: str, command: np.ndarray):
    """The drive torque (N,) that an effect makes of a command (N,), a value a physics step."""
    simulated = SimulatedRobot(arm, STEP_SIZE, RATE, np.ones(arm.joints))
    acting = effect(name).action(Injection(name, joint, values, law), simulated)
    bus, out = np.zeros((arm.joints, BUS_ROWS)), []
    for step, asked in enumerate(command):
        bus[:, STEP], bus[:, TIMESTEP] = step, STEP_SIZE
        bus[:, COMMAND] = bus[:, DRIVE] = asked
        for each in acting.hooks:
            each.kernel(bus, each.parameters, each.state, each.joint)
        out.append(bus[joint or 0, DRIVE])
    return np.array(out)


# Step by step


@pytest.mark.parametrize("delay", [0.0, 0.0008, 0.00111])
def test_a_delay_shifts_a_ramp_by_itself(arm, delay):
    ramp = 5.0 * STEP_SIZE * np.arange(200)
    out = driven(arm, "torque_delay", None, {"delay": delay}, "default", ramp)
    np.testing.assert_allclose(out[50:], ramp[50:] - 5.0 * delay, atol=1e-12)


def test_a_joint_may_be_late_alone(arm):
    ramp = 5.0 * STEP_SIZE * np.arange(200)
    out = driven(arm, "torque_delay", 2, {"delay": 0.003}, "default", ramp)
    np.testing.assert_allclose(out[50:], ramp[50:] - 5.0 * 0.003, atol=1e-12)
    simulated = SimulatedRobot(arm, STEP_SIZE, RATE, np.ones(arm.joints))
    acting = effect("torque_delay").action(
        Injection("torque_delay", 2, {"delay": 0.003}, "default"), simulated
    )
    assert [each.joint for each in acting.hooks] == [2]


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


# In closed loop


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


# Signatures along exact motions


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


def test_a_delay_of_one_joint_is_the_common_ones_share_of_it(exact):
    own, common = (effect("torque_delay").signature([exact], joint, None) for joint in (2, None))
    for one, all_ in zip(own.members, common.members, strict=True):
        assert one.rows == (2,)
        np.testing.assert_array_equal(one.columns[0], all_.columns[0][:, [2]])


@pytest.mark.parametrize(("law", "member"), [("first_order", 0), ("second_order", 2)])
def test_a_lag_is_explained(arm, motion, exact, law, member):
    """reported = true + T d(true)/dt, two stages + T²/4 d²(true)/dt², of the smooth part in closed form."""
    time_constant = 0.012
    smooth = exact.predicted[:, 2] - arm.parameters.reshape(6, -1)[2, 12] * np.sign(exact.dq[:, 2])
    before, now, after = (
        torque(arm, *motion.evaluate(exact.time + shift))[:, 2] for shift in (-1e-4, 0.0, 1e-4)
    )
    reversal = np.abs(np.diff(np.sign(exact.dq[:, 2]), append=0)) > 0
    quiet = ~np.convolve(reversal, np.ones(9), "same").astype(bool)
    quiet[:4] = quiet[-4:] = False
    change = time_constant * (after - before) / 2e-4
    if law == "second_order":
        change += time_constant**2 / 4 * (after - 2 * now + before) / 1e-8
    assert rms(smooth) > 1
    family = effect("actuator_lag").signature([exact], 2, None)
    assert family.members[member].law in (None, law)
    column = family.members[member].columns[0][:, 0, 0]
    assert rms((column * time_constant - change)[quiet]) < 0.02 * rms(change[quiet])


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
