"""The simulated robot against closed forms, brute force, and itself on other threads and steps."""

import itertools
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

from identification.errors import InputError
from identification.regressor import regressor
from testbench.log import Recording
from testbench.robot import Robot, load_robot
from testbench.simulation import (
    ControllerOptions,
    Reference,
    SensorOptions,
    SimulationOptions,
    batch,
    layout,
    sample_reference,
    simulate,
)
from testbench.simulation.friction import coulomb_friction
from testbench.simulation.plant import plant_model
from testbench.simulation.sensors import centred_torque, encoder_quantum, measured_torque, white_noise

BLOCK = """
<mujoco model="block"><worldbody><body><inertial pos="0 0 0" mass="2" diaginertia="1 1 1"/>
  <joint name="rail" type="slide" axis="1 0 0" frictionloss="3" actuatorfrcrange="-50 50"/>
</body></worldbody></mujoco>
"""
PENDULUM = """
<mujoco model="pendulum"><worldbody><body><inertial pos="0.1 0.4 0" mass="3" diaginertia="0.05 0.02 0.06"/>
  <joint name="hinge" axis="0 1 1" armature="0.2" damping="1.5" frictionloss="2" actuatorfrcrange="-60 60"/>
</body></worldbody></mujoco>
"""
ARM = """
<mujoco model="arm"><worldbody>
  <body pos="0 0 0.3"><inertial pos="0 0.05 0.1" mass="6" diaginertia="0.1 0.1 0.08"/>
    <joint name="turn" axis="0 0 1" armature="0.3" damping="4" frictionloss="3" actuatorfrcrange="-120 120"/>
    <body pos="0.1 0 0.2"><inertial pos="0.2 0 0" mass="4" diaginertia="0.02 0.09 0.09"/>
      <joint name="lift" axis="0 1 0" armature="0.2" damping="3" frictionloss="2"
             actuatorfrcrange="-120 120"/>
      <body pos="0.4 0 0"><inertial pos="0.15 0 0.02" mass="2" diaginertia="0.01 0.03 0.03"/>
        <joint name="reach" type="slide" axis="1 0 0" armature="1" damping="20" frictionloss="9"
               actuatorfrcrange="-200 200"/>
      </body></body></body></worldbody>
  <actuator><position joint="lift" kp="1000"/></actuator></mujoco>
"""
RATE = 1000.0


@dataclass(frozen=True)
class Sines:
    """q = amplitude (1 - cos(2 pi k t / T)): at rest at both ends."""

    amplitude: tuple[float, ...]
    cycles: tuple[int, ...]
    duration: float = 2.0

    @property
    def joints(self) -> int:
        return len(self.amplitude)

    def evaluate(self, time: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        a, w = np.array(self.amplitude), 2 * np.pi * np.array(self.cycles) / self.duration
        angle = np.outer(time, w)
        return a * (1 - np.cos(angle)), a * w * np.sin(angle), a * w**2 * np.cos(angle)


def robot_from(xml: str, folder: Path) -> Robot:
    path = folder / "robot.xml"
    path.write_text(xml)
    return load_robot(path)


@pytest.fixture(scope="module")
def block(tmp_path_factory: pytest.TempPathFactory) -> Robot:
    return robot_from(BLOCK, tmp_path_factory.mktemp("block"))


@pytest.fixture(scope="module")
def pendulum(tmp_path_factory: pytest.TempPathFactory) -> Robot:
    return robot_from(PENDULUM, tmp_path_factory.mktemp("pendulum"))


@pytest.fixture(scope="module")
def arm(tmp_path_factory: pytest.TempPathFactory) -> Robot:
    return robot_from(ARM, tmp_path_factory.mktemp("arm"))


ARM_MOTION = sample_reference(Sines((0.5, 0.3, 0.1), (1, 2, 3)), RATE)
NOISY = SensorOptions(encoder_bits=16, slide_resolution=1e-5, position_noise=1e-5, torque_noise=0.01)


def pushed(robot: Robot, force: np.ndarray, timestep: float) -> np.ndarray:
    """Loop output of an uncontrolled robot pushed by a force (N, n) at 1 kHz."""
    samples, n = force.shape
    constants = np.zeros((layout.CONSTANTS, n))
    constants[layout.COULOMB], constants[layout.TORQUE_LIMIT] = robot.model.dof_frictionloss, np.inf
    inputs = np.zeros((samples, layout.INPUTS, n))
    inputs[:, layout.FEEDFORWARD] = force
    plant = plant_model(robot.model, timestep)
    loop = batch.Loop(plant, round(1e-3 / timestep), RATE, 0.0, constants, inputs, np.zeros(n), np.zeros(n))
    return batch.run_loops([loop], 1)[0]


def arrays(recording: Recording) -> dict[str, np.ndarray]:
    found = {name: value for name, value in vars(recording).items() if isinstance(value, np.ndarray)}
    return found | {f"truth {name}": value for name, value in recording.truth.items()}


def same(one: Recording, other: Recording) -> bool:
    a, b = arrays(one), arrays(other)
    return a.keys() == b.keys() and all(np.array_equal(a[name], b[name]) for name in a)


# Exact Coulomb friction


@pytest.mark.parametrize("timestep", [1e-3, 1e-4])
def test_a_pushed_block_slides_and_stops_as_in_the_closed_form(block: Robot, timestep: float) -> None:
    mass, coulomb, push, pushing = 2.0, 3.0, 7.0, 0.4
    force = np.zeros((1500, 1))
    force[: round(pushing * RATE)] = push
    output = pushed(block, force, timestep)
    position, velocity = output[:, layout.POSITION, 0], output[:, layout.VELOCITY, 0]
    top = (push - coulomb) / mass * pushing
    distance = top * pushing / 2 + top**2 / (2 * coulomb / mass)
    # Piecewise constant acceleration: velocity is exact, position a rectangle rule.
    assert velocity.max() == pytest.approx(top, rel=1e-12)
    assert position[-1] == pytest.approx(distance, abs=top * timestep)
    # What the push put in, friction took out.
    work = push * position[round(pushing * RATE)]
    assert work == pytest.approx(coulomb * position[-1], abs=2 * push * top * timestep)
    at_rest = round((pushing + top / (coulomb / mass)) * RATE) + 2
    assert np.abs(velocity[at_rest:]).max() < 1e-15
    assert np.ptp(position[at_rest:]) < 1e-15


def test_a_block_pushed_with_less_than_its_friction_does_not_creep(block: Robot) -> None:
    force = 2.99 * np.sin(np.linspace(0, 30, 2000))[:, None]
    output = pushed(block, force, 1e-3)
    assert np.abs(output[:, layout.POSITION]).max() < 1e-15
    held = (force[:-1] + force[1:]) / 2
    np.testing.assert_allclose(output[1:, layout.FRICTION], held, atol=1e-12)


def test_friction_of_a_coupled_arm_is_the_solution_found_by_trying_every_mode(arm: Robot) -> None:
    plant, coulomb, h = plant_model(arm.model, 1e-3), np.array(arm.model.dof_frictionloss), 1e-3
    data, random = mujoco.MjData(plant), np.random.default_rng(3)
    modes = set()
    for _ in range(60):
        data.qpos[:], data.qvel[:] = random.normal(size=3), 0.02 * random.normal(size=3)
        mujoco.mj_forward(plant, data)
        force = 6 * random.normal(size=3)
        inverse = np.zeros((3, 3))
        mujoco.mj_solveM(plant, data, inverse, np.eye(3))
        friction = np.zeros(3)
        work = np.zeros((8, 3))
        coulomb_friction(plant._address, data._address, h, data.qvel.copy(), force, coulomb, friction, work)
        expected, mode = every_mode(np.array(data.qvel), force, inverse, coulomb, h)
        modes.add(mode)
        np.testing.assert_allclose(friction, expected, atol=1e-9)
    assert len(modes) > 10


def every_mode(
    velocity: np.ndarray, force: np.ndarray, inverse: np.ndarray, coulomb: np.ndarray, h: float
) -> tuple[np.ndarray, tuple[int, ...]]:
    """Friction of the one consistent choice among 3^n: sliding back (-1), sticking (0), sliding on (1)."""
    for mode in itertools.product((-1, 0, 1), repeat=len(velocity)):
        stuck = np.array(mode) == 0
        friction = coulomb * mode
        free = velocity + h * inverse @ (force - friction)
        friction[stuck] = np.linalg.solve(h * inverse[np.ix_(stuck, stuck)], free[stuck])
        after = velocity + h * inverse @ (force - friction)
        if (np.abs(friction) <= coulomb * (1 + 1e-12)).all() and (
            np.sign(after[~stuck]) == np.array(mode)[~stuck]
        ).all():
            return friction, mode
    raise AssertionError("no consistent mode")


# The closed loop


def test_a_right_model_tracks_better_than_pd_alone(arm: Robot) -> None:
    both = [SimulationOptions(ControllerOptions(kind)) for kind in ("pd_with_model_feedforward", "pd")]
    errors = []
    for recording in simulate(arm, [ARM_MOTION] * 2, both):
        errors.append(np.abs(recording.position - ARM_MOTION.position).max(axis=0))
    assert (errors[0] < 0.02 * np.ptp(ARM_MOTION.position, axis=0)).all()
    assert (errors[0] < errors[1] / 4).all()


@pytest.mark.parametrize("kind", ["pd_with_model_feedforward", "pd"])
def test_a_run_starts_at_rest_in_balance_with_gravity(arm: Robot, kind: str) -> None:
    standing = Reference(np.full((50, 3), 0.2), np.zeros((50, 3)), np.zeros((50, 3)))
    light = replace(arm, parameters=0.5 * arm.parameters)
    (recording,) = simulate(arm, [standing], SimulationOptions(ControllerOptions(kind)), nominal=light)
    assert np.abs(recording.truth["velocity"]).max() < 1e-12
    assert np.abs(recording.position - 0.2).max() > 1e-3


def test_command_follows_the_contract_formula(arm: Robot) -> None:
    options = SimulationOptions(ControllerOptions(kp=[900, 800, 4000], kd=[60, 50, 200], velocity_cutoff=1e6))
    (recording,) = simulate(arm, [ARM_MOTION], options)
    q, dq, ddq = ARM_MOTION.position, ARM_MOTION.velocity, ARM_MOTION.acceleration
    smoothing = recording.controller.coulomb_smoothing
    forward = regressor(arm.chain, q, dq, ddq, coulomb_velocity=smoothing) @ arm.parameters
    # With the cut-off beyond the rate, the measured velocity is the plain backward difference.
    velocity = np.diff(recording.position, axis=0, prepend=recording.position[:1]) * RATE
    command = (
        forward
        + recording.controller.kp * (q - recording.position)
        + recording.controller.kd * (dq - velocity)
    )
    limit = arm.limits.torque
    np.testing.assert_allclose(recording.torque_command, np.clip(command, -limit, limit), atol=1e-8)


def test_rigid_body_dynamics_hold_in_the_truth_to_first_order(arm: Robot) -> None:
    frictionless = arm.parameters.reshape(-1, 14).copy()
    frictionless[:, 11:13] = 0
    largest = []
    for recording in simulate(
        arm, [ARM_MOTION] * 2, [SimulationOptions(physics_timestep=h) for h in (1e-4, 5e-5)]
    ):
        truth = recording.truth
        rows = regressor(arm.chain, truth["position"], truth["velocity"], truth["acceleration"])
        residual = truth["torque"] - truth["friction_torque"] - rows @ frictionless.ravel()
        largest.append(np.abs(residual).max())
        # Away from reversals the friction is fv v + fc sgn(v), to the last bit.
        sliding = np.abs(truth["velocity"]) > 0.02
        law = arm.model.dof_damping * truth["velocity"] + arm.model.dof_frictionloss * np.sign(
            truth["velocity"]
        )
        assert np.abs(truth["friction_torque"] - law)[sliding].max() < 1e-12
    # Half a step of motion, at up to 2 rad/s, times 50 N·m/rad of gravity and inertia.
    assert largest[0] < 2 * 0.5e-4 * 50
    assert largest[0] / largest[1] > 1.8


def identified(recording: Recording, robot: Robot, torque: np.ndarray) -> np.ndarray:
    """Largest relative error of the pendulum's parameters, from differences of the logged position."""
    q = recording.position
    dq = (q[2:] - q[:-2]) * RATE / 2
    ddq = (q[2:] - 2 * q[1:-1] + q[:-2]) * RATE**2
    moving = np.abs(dq[:, 0]) > 0.1
    columns = np.array([5, 6, 7, 11, 12])
    rows = regressor(robot.chain, q[1:-1], dq, ddq, columns)[moving, 0]
    estimate = np.linalg.lstsq(rows, torque[1:-1][moving, 0], rcond=None)[0]
    truth = robot.parameters[columns]
    truth[0] += robot.parameters[10]
    return np.abs(estimate / truth - 1).max()


def test_logged_torque_and_motion_are_aligned_in_time(pendulum: Robot) -> None:
    motion = sample_reference(Sines((1.0,), (2,)), RATE, periods=2)
    halves = [SimulationOptions(physics_timestep=h) for h in (1e-3, 1e-4)]
    coarse, fine = simulate(pendulum, [motion] * 2, halves)
    # Central differences over T of a motion of w rad/s are off by (w T)^2 / 6; w up to 3 · 2 pi rad/s.
    differences = (3 * 2 * np.pi / RATE) ** 2 / 6
    assert identified(fine, pendulum, fine.torque) < 2 * differences
    # The plant is second order, so even physics at the controller's rate leaves little bias.
    assert identified(coarse, pendulum, coarse.torque) < 4 * differences
    # Half a control period late: visible in the same fit.
    assert identified(fine, pendulum, fine.torque_command) > 50 * identified(fine, pendulum, fine.torque)


def test_a_finer_physics_step_converges_at_first_order(arm: Robot) -> None:
    steps = [1e-3, 1.25e-4, 1.5625e-5]
    runs = simulate(arm, [ARM_MOTION] * 3, [SimulationOptions(physics_timestep=h) for h in steps])
    errors = [np.abs(run.position - runs[-1].position).max() for run in runs[:-1]]
    # An eighth of the step, an eighth of the error; instants of reversal make it ragged.
    assert errors[0] / errors[1] > 5
    assert errors[1] < 1e-5


# Repeatability


def test_results_do_not_depend_on_threads_or_on_the_other_runs(arm: Robot) -> None:
    options = SimulationOptions(sensors=NOISY, physics_timestep=1e-3)
    short = Reference(ARM_MOTION.position[:700], ARM_MOTION.velocity[:700], ARM_MOTION.acceleration[:700])
    references = [ARM_MOTION, short, ARM_MOTION]
    one = simulate(arm, references, options, seed=5, threads=1)
    two = simulate(arm, references, options, seed=5, threads=2)
    alone = [
        simulate(arm, [reference], options, seed=[stream])[0]
        for reference, stream in zip(references, np.random.SeedSequence(5).spawn(3), strict=True)
    ]
    assert all(map(same, one, two))
    assert all(map(same, one, alone))
    assert not same(one[0], one[2])
    assert not same(one[0], simulate(arm, references[:1], options, seed=6)[0])


def test_robots_that_differ_run_in_one_batch(arm: Robot, tmp_path: Path) -> None:
    heavy = robot_from(ARM.replace('mass="2"', 'mass="3"'), tmp_path)
    mixed = simulate([arm, heavy], [ARM_MOTION] * 2)
    assert same(mixed[0], simulate(arm, [ARM_MOTION])[0])
    assert same(mixed[1], simulate(heavy, [ARM_MOTION])[0])
    assert not same(*mixed)


def test_the_callbacks_of_mujoco_are_put_back(arm: Robot) -> None:
    data = mujoco.MjData(arm.model)
    calls = []
    mujoco.set_mjcb_control(lambda model, data: calls.append(1))
    try:
        simulate(arm, [ARM_MOTION])
        assert not calls
        mujoco.mj_step(arm.model, data)
        assert len(calls) == 1
    finally:
        mujoco.set_mjcb_control(None)


# Sensors


def test_encoder_readings_lie_on_the_grid_nearest_the_truth(arm: Robot) -> None:
    sensors = SensorOptions(encoder_bits=14, slide_resolution=2e-5)
    (recording,) = simulate(arm, [ARM_MOTION], SimulationOptions(sensors=sensors))
    quantum = encoder_quantum(sensors, arm.chain.is_slide)
    np.testing.assert_allclose(quantum, [2 * np.pi / 2**14, 2 * np.pi / 2**14, 2e-5])
    counts = recording.position / quantum
    assert np.abs(counts - np.rint(counts)).max() < 1e-9
    assert (np.abs(recording.position - recording.truth["position"]) <= quantum / 2 * (1 + 1e-9)).all()


def test_position_noise_has_its_standard_deviation(arm: Robot) -> None:
    sensors = SensorOptions(position_noise=[1e-4, 2e-4, 3e-5])
    (recording,) = simulate(arm, [ARM_MOTION], SimulationOptions(sensors=sensors))
    deviation = (recording.position - recording.truth["position"]).std(axis=0)
    # Relative standard error of a standard deviation: 1 / sqrt(2 N); five of them.
    np.testing.assert_allclose(deviation, sensors.position_noise, rtol=5 / np.sqrt(2 * len(recording.time)))


@pytest.mark.parametrize("correlation", [0.0, 0.004])
def test_torque_noise_has_its_standard_deviation_colour_and_bias(correlation: float) -> None:
    samples, deviation = 40_000, np.array([0.5, 2.0])
    sensors = SensorOptions(torque_correlation_time=correlation, torque_bias=[1.0, -3.0])
    white = white_noise(np.random.SeedSequence(1), 0, (samples, 2))
    noise = measured_torque(np.zeros((samples, 2)), white, RATE, deviation, sensors)
    pole = np.exp(-1 / (RATE * correlation)) if correlation else 0.0
    # Independent samples in an AR(1) series of N: N (1 - p) / (1 + p).
    standard_error = np.sqrt((1 + pole) / (1 - pole) / samples)
    assert (np.abs(noise.mean(axis=0) - sensors.torque_bias) < 5 * deviation * standard_error).all()
    np.testing.assert_allclose(noise.std(axis=0), deviation, rtol=5 * standard_error)
    centred = (noise - noise.mean(axis=0)) / noise.std(axis=0)
    np.testing.assert_allclose((centred[1:] * centred[:-1]).mean(axis=0), pole, atol=5 * standard_error)


def test_torque_noise_is_a_fraction_of_the_limit(arm: Robot) -> None:
    options = SimulationOptions(sensors=SensorOptions(torque_noise=0.02))
    (recording,) = simulate(arm, [ARM_MOTION], options)
    deviation = (recording.torque - recording.truth["torque"]).std(axis=0)
    tolerance = 5 / np.sqrt(2 * len(recording.time))
    np.testing.assert_allclose(deviation, 0.02 * arm.limits.torque, rtol=tolerance)


def test_delayed_torque_is_the_mean_over_a_window_that_is_late() -> None:
    held, before = np.random.default_rng(0).normal(size=(30, 3)), np.array([1.0, 2.0, 3.0])
    got = centred_torque(held, before, np.array([0.0, 0.5e-3, 2.3e-3]), RATE)
    padded = np.vstack([before] * 4 + [held])
    now, back = padded[4:], [padded[4 - lag : -lag] for lag in (1, 2, 3)]
    np.testing.assert_allclose(got[:, 0], 0.5 * (now + back[0])[:, 0])
    np.testing.assert_allclose(got[:, 1], back[0][:, 1])
    # 2.3 periods late: the window reaches from 2.8 to 1.8 periods ago.
    np.testing.assert_allclose(got[:, 2], 0.8 * back[2][:, 2] + 0.2 * back[1][:, 2])


# Errors


@pytest.mark.parametrize(
    ("build", "says"),
    [
        (lambda: ControllerOptions("pid"), "valid: pd_with_model_feedforward, pd"),
        (lambda: ControllerOptions(rate=0), "rate"),
        (lambda: SimulationOptions(physics_timestep=3e-4), "divides the control period"),
        (lambda: sample_reference(Sines((1.0,), (1,)), -1), "rate"),
        (
            lambda: Reference(np.full((9, 1), np.nan), np.zeros((9, 1)), np.zeros((9, 1))),
            "nan at sample 0, joint 1",
        ),
        (lambda: Reference(np.zeros((9, 1)), np.zeros((9, 2)), np.zeros((9, 1))), "velocity"),
    ],
)
def test_wrong_options_are_refused_in_one_line(build: Callable[[], object], says: str) -> None:
    with pytest.raises(InputError) as error:
        build()
    assert says in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (SimulationOptions(ControllerOptions(kd=[1e5, 1e5, 1e6])), "stable loop"),
        (SimulationOptions(ControllerOptions("pd", kp=0.01)), "hold the arm"),
        (SimulationOptions(ControllerOptions(kp=[1, 2])), "kp"),
        (SimulationOptions(sensors=SensorOptions(torque_noise=-1)), "torque_noise"),
    ],
)
def test_runs_that_cannot_work_are_refused(
    arm: Robot, options: SimulationOptions, says: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    unlimited = replace(arm, limits=replace(arm.limits, torque=np.full(3, np.inf)))
    with pytest.raises(InputError) as error:
        simulate(arm, [ARM_MOTION], options, nominal=unlimited)
    assert says in str(error.value)
    assert not list(tmp_path.iterdir())


def test_an_arm_too_heavy_for_its_drives_is_refused(arm: Robot) -> None:
    weak = replace(arm, limits=replace(arm.limits, torque=np.full(3, 5.0)))
    with pytest.raises(InputError, match="torque limit"):
        simulate(weak, [ARM_MOTION])


def test_joints_of_reference_and_robot_must_agree(pendulum: Robot) -> None:
    with pytest.raises(InputError, match="1 joints"):
        simulate(pendulum, [ARM_MOTION])
