"""Estimators that integrate or simulate the robot, against a known truth in the simulated robot."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from identification.base_parameters import base_parameters
from identification.closed_loop import standard_candidate
from identification.errors import InputError
from identification.estimators import estimate
from identification.excitation.design import random_excitation
from identification.excitation.excitation import DesignOptions
from identification.excitation.trajectories import trajectory_basis
from identification.models import Preprocessing, observe
from identification.parameters import INERTIAL, OFFSET, PER_JOINT
from identification.problem import Problem
from identification.simulated_motion import simulatable
from testbench.closed_loop import recorded_loops
from testbench.comparison import cramer_rao
from testbench.log import Controller
from testbench.model_error import ModelError, nominal_parameters
from testbench.robot import load_robot
from testbench.sampling import motion
from testbench.simulation import (
    ControllerOptions,
    SensorOptions,
    SimulationOptions,
    sample_reference,
    simulate,
)

from .synthetic import synthetic_robot

ENCODER = 1.4e-5  # rad, the rounding of a 17-bit encoder
TORQUE = 0.5  # N·m (N) on the small arm
QUICK = ("didim", "extended_kalman", "instrumental_variable")
ALL = (*QUICK, "output_error")


@dataclass(frozen=True)
class Known:
    """A problem, what it was simulated from, and the truth."""

    problem: Problem
    recording: object
    truth: np.ndarray


def _motion(robot, speed):
    """A random 5 s motion about the middle of the range."""
    basis = trajectory_basis("fourier", 0.2, 5)
    coefficients = speed * np.random.default_rng(0).normal(size=(basis.size, robot.joints))
    coefficients[0] = (robot.limits.lower + robot.limits.upper) / 2
    return basis.trajectory(coefficients)


def _known(robot, trajectory, encoder=0.0, torque=0.0, seed=0, controller="pd_with_model_feedforward"):
    """A run under a controller whose nominal model is as wrong as CAD. torque: share of the limit."""
    nominal = replace(robot, parameters=nominal_parameters(robot, ModelError(), seed))
    (recording,) = simulate(
        robot,
        [sample_reference(trajectory, 1000.0)],
        SimulationOptions(
            controller=ControllerOptions(kind=controller),
            sensors=SensorOptions(position_noise=encoder, torque_noise=torque),
            physics_timestep=2e-4,
        ),
        nominal,
        seed,
    )
    base, settings, run = base_parameters(robot.chain), Preprocessing(), motion(recording)
    observed = observe(robot.chain, base, run, settings)
    loops = recorded_loops(nominal, [recording])
    problem = Problem(robot.chain, base, (observed,), (run,), settings, nominal.parameters, loops)
    return Known(problem, recording, base.values(robot.parameters))


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    """Two hinges and a slide, with torque limits so that noise can be a share of them."""
    robot = synthetic_robot(tmp_path_factory.mktemp("model"))
    return replace(robot, limits=replace(robot.limits, torque=np.full(3, 300.0)))


@pytest.fixture(scope="module")
def exact(small):
    return _known(small, _motion(small, 0.5))


@pytest.fixture(scope="module")
def noisy(small):
    return _known(small, _motion(small, 0.5), ENCODER, TORQUE / 300.0)


def _assert_truth(known, name):
    found = estimate(known.problem, name)
    assert found.estimator == name
    assert np.abs(found.values - known.truth).max() < 1e-3 * np.abs(known.truth).max()


@pytest.mark.parametrize("name", ALL)
def test_exact_sensors_return_the_truth(exact, name):
    _assert_truth(exact, name)


@pytest.mark.parametrize("model", ["tx90", "rail_arm"])
def test_large_arms_return_the_truth(models, model):
    robot = load_robot(models / f"{model}.xml")
    exciting = random_excitation(robot.chain, robot.parameters, robot.limits, DesignOptions(seed=3))
    known = _known(robot, exciting.trajectory)
    for name in QUICK:
        _assert_truth(known, name)


def test_without_feedforward_they_return_the_truth(small):
    known = _known(small, _motion(small, 0.3), controller="pd")
    for name in ("didim", "instrumental_variable"):
        _assert_truth(known, name)


@pytest.mark.parametrize("name", ALL)
def test_noisy_sensors_cost_about_the_cramer_rao_bound(noisy, small, name):
    found = estimate(noisy.problem, name)
    bound = cramer_rao(small.chain, found.base, [noisy.recording], np.full(3, TORQUE), 0.0)
    # Half of all normal errors are within 0.67 deviations.
    assert np.median(np.abs(found.values - noisy.truth) / bound) < 1.5 * 0.67
    # 13 parameters: beyond four of their own deviations by chance once in a thousand runs.
    assert np.all(np.abs(found.values - noisy.truth) < 4 * found.std)


@pytest.mark.parametrize("name", QUICK)
def test_the_same_input_gives_the_same_bits(noisy, name):
    first, second = estimate(noisy.problem, name), estimate(replace(noisy.problem), name)
    assert np.array_equal(first.values, second.values)
    assert np.array_equal(first.covariance, second.covariance)


def test_the_test_of_exogeneity_tells_noisy_encoders_from_exact_ones(models):
    robot = load_robot(models / "tx90.xml")
    motion = _motion(robot, 0.4)
    exact, loud = (_known(robot, motion, encoder, 0.01) for encoder in (0.0, 20 * ENCODER))
    assert estimate(exact.problem, "instrumental_variable").exogeneity_p_value > 1e-3
    assert estimate(loud.problem, "instrumental_variable").exogeneity_p_value < 1e-6


def test_the_filter_starts_from_the_nominal_model(exact):
    nominal = exact.problem.base.values(exact.problem.nominal)
    assert np.abs(nominal - exact.truth).max() > 0.02 * np.abs(exact.truth).max()


@pytest.mark.parametrize("name", ["didim", "instrumental_variable", "output_error"])
def test_a_log_without_reference_is_reported_so(noisy, name):
    with pytest.raises(InputError, match="reference and controller"):
        estimate(replace(noisy.problem, closed_loop=None), name)


@pytest.mark.parametrize("name", ["didim", "instrumental_variable"])
def test_equations_without_torque_are_refused(noisy, name):
    energy = replace(noisy.problem.preprocessing, model="energy")
    with pytest.raises(InputError, match="inverse_dynamic"):
        estimate(replace(noisy.problem, preprocessing=energy), name)


def test_recordings_of_unknown_controllers_cannot_be_simulated(noisy, small):
    assert recorded_loops(small, [replace(noisy.recording, reference_position=None)]) is None
    unknown = replace(noisy.recording, controller=Controller("unknown", 1000.0))
    with pytest.raises(InputError, match="controller with its gains"):
        recorded_loops(small, [unknown]).simulate(small.parameters[None])
    slower = replace(noisy.recording, controller=replace(noisy.recording.controller, rate=500.0))
    with pytest.raises(InputError, match="one sample a tick"):
        recorded_loops(small, [slower]).simulate(small.parameters[None])
    bare = replace(noisy.recording, reference_acceleration=None)
    with pytest.raises(InputError, match="reference/acceleration"):
        recorded_loops(small, [bare]).simulate(small.parameters[None])


def test_the_true_candidate_moves_as_logged_on_any_number_of_threads(exact, small):
    simulated = [
        replace(exact.problem.closed_loop, threads=threads).simulate(np.tile(small.parameters, (3, 1)))
        for threads in (1, 2)
    ]
    run = simulated[0][0][0]
    # The log was made in other steps of time; the error is of first order around reversals.
    assert np.abs(run.q - exact.recording.position).max() < 5e-6
    for one, two in zip(simulated[0], simulated[1], strict=True):
        assert np.array_equal(one[0].ddq, two[0].ddq)


def test_the_simulated_controller_reads_the_noise_of_the_logged_encoders(small):
    weak = replace(small, limits=replace(small.limits, torque=np.array([100.0, 45.0, 90.0])))
    known = _known(weak, _motion(weak, 0.5), 30 * ENCODER)
    # The noise drives the command to the limits, where its mean is not what it would be without.
    assert (np.abs(known.recording.torque_command) >= weak.limits.torque).mean() > 0.05
    ((moved,),) = known.problem.closed_loop.simulate(weak.parameters[None])
    aside = np.sqrt(np.mean((moved.q - known.recording.truth["position"]) ** 2, axis=0))
    assert np.all(aside < 0.5 * 30 * ENCODER)


def test_an_offset_acts_like_a_constant_load(exact, small):
    shifted = small.parameters.copy()
    shifted[OFFSET] += 5.0
    one, two = exact.problem.closed_loop.simulate(np.array([small.parameters, shifted]))
    # At rest a PD controller gives way by load over stiffness.
    gain = exact.recording.controller.kp[0]
    assert two[0].q[0, 0] - one[0].q[0, 0] == pytest.approx(-5.0 / gain, rel=1e-6)


def test_a_candidate_has_the_base_values_and_nothing_that_was_not_sought(small):
    base = base_parameters(small.chain, ("inertial", "armature", "viscous"))
    values = base.values(small.parameters) + 0.1
    standard = standard_candidate(base, small.parameters, values)
    assert base.values(standard) == pytest.approx(values)
    assert not standard.reshape(-1, PER_JOINT)[:, INERTIAL + 2].any()


def test_impossible_inertia_is_drawn_towards_the_nominal_model(noisy):
    problem = noisy.problem
    nominal = problem.base.values(problem.nominal)
    assert np.array_equal(simulatable(problem, noisy.truth), nominal + (noisy.truth - nominal))
    flipped = nominal - 3 * (np.abs(nominal))
    drawn = simulatable(problem, flipped)
    assert np.linalg.norm(drawn - nominal) < np.linalg.norm(flipped - nominal)
    problem.closed_loop.simulate(standard_candidate(problem.base, problem.nominal, drawn)[None])
