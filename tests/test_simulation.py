"""The simulated robot's closed loop: its laws, itself on other threads and steps, and what it refuses."""

import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

from identification.errors import InputError
from identification.regressor import regressor
from testbench.log import Recording
from testbench.robot import Robot
from testbench.simulation import (
    ControllerOptions,
    Reference,
    SensorOptions,
    SimulationOptions,
    sample_reference,
    simulate,
)

from .simulated_arm import ARM, ARM_MOTION, RATE, Sines, robot_from, same

PENDULUM = """
<mujoco model="pendulum"><worldbody><body><inertial pos="0.1 0.4 0" mass="3" diaginertia="0.05 0.02 0.06"/>
  <joint name="hinge" axis="0 1 1" armature="0.2" damping="1.5" frictionloss="2" actuatorfrcrange="-60 60"/>
</body></worldbody></mujoco>
"""
NOISY = SensorOptions(encoder_bits=16, slide_resolution=1e-5, position_noise=1e-5, torque_noise=0.01)


@pytest.fixture(scope="module")
def pendulum(tmp_path_factory: pytest.TempPathFactory) -> Robot:
    return robot_from(PENDULUM, tmp_path_factory.mktemp("pendulum"))


@pytest.fixture(scope="module")
def arm(tmp_path_factory: pytest.TempPathFactory) -> Robot:
    return robot_from(ARM, tmp_path_factory.mktemp("arm"))


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
    # A bandwidth that no step has to bound: one controller for all.
    slow = ControllerOptions(bandwidth=3)
    runs = simulate(arm, [ARM_MOTION] * 3, [SimulationOptions(slow, physics_timestep=h) for h in steps])
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


def test_models_are_compiled_while_a_simulation_runs(arm: Robot) -> None:
    text, finished = arm.path.read_text(), threading.Event()

    def compile_models() -> int:
        count = 0
        while not finished.is_set():
            mujoco.MjModel.from_xml_string(text)
            count += 1
        return count

    with ThreadPoolExecutor(1) as beside:
        compiled = beside.submit(compile_models)
        (alongside,) = simulate(arm, [ARM_MOTION])
        finished.set()
        assert compiled.result() > 10
    (alone,) = simulate(arm, [ARM_MOTION])
    np.testing.assert_array_equal(alongside.torque, alone.torque)


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
