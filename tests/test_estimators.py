"""The linear estimators and identification models against a known truth, without a simulator."""

from dataclasses import replace

import numpy as np
import pytest

from identification.base_parameters import base_parameters
from identification.errors import InputError
from identification.estimators import estimate
from identification.estimators.recursive_tls import RecursiveTotalLeastSquares
from identification.inverse_dynamics import inverse_dynamics
from identification.measurement_noise import position_noise_std
from identification.models import Preprocessing, identification_models, observe
from identification.parameters import ARMATURE, COULOMB, INERTIAL, PER_JOINT, pseudo_inertia
from identification.physical_consistency import consistent_standard_parameters
from identification.pipeline import IdentificationOptions, identify
from identification.problem import Problem
from identification.signals import Motion, Signals
from testbench.robot import load_robot

from .synthetic import synthetic_robot

RATE = 500.0
ENCODER = 1.4e-5  # rad, a 17-bit encoder's rounding
ESTIMATORS = ("irls", "maximum_likelihood", "ols", "physically_consistent", "recursive_tls", "tls", "wls")


@pytest.fixture(scope="module", params=["tx90", "rail_arm"])
def robot(request, models):
    return load_robot(models / f"{request.param}.xml")


@pytest.fixture(scope="module")
def tx90(models):
    return load_robot(models / "tx90.xml")


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    """Two hinges and a slide."""
    return synthetic_robot(tmp_path_factory.mktemp("model"))


def _exact(robot, seconds=10.0, seed=0):
    """A smooth random motion inside the range with its exact torque."""
    rng = np.random.default_rng(seed)
    time = np.arange(0, seconds, 1 / RATE)[:, None]
    span = np.minimum(robot.limits.upper - robot.limits.lower, 4.0)
    q, dq, ddq = np.zeros((3, len(time), robot.joints))
    for harmonic in range(1, 6):
        w = 2 * np.pi * harmonic / 10
        a = rng.uniform(0.3, 1.0, robot.joints) * span / 16
        angle = w * time + rng.uniform(0, 2 * np.pi, robot.joints)
        q += a * np.sin(angle)
        dq += a * w * np.cos(angle)
        ddq -= a * w**2 * np.sin(angle)
    return Signals(q, dq, ddq, inverse_dynamics(robot.chain, robot.parameters, q, dq, ddq), RATE, 0)


def _measured(signals, encoder=0.0, torque=0.0, seed=0):
    """Position noise in rad, torque noise as a share of each joint's torque RMS."""
    rng = np.random.default_rng(1000 + seed)
    level = torque * np.sqrt(np.mean(signals.tau**2, axis=0))
    return Motion(
        signals.q + encoder * rng.standard_normal(signals.q.shape),
        signals.tau + level * rng.standard_normal(signals.tau.shape),
        RATE,
    )


def _exact_problem(robot, model="inverse_dynamic", **arguments):
    signals = _exact(robot, **arguments)
    base, settings = base_parameters(robot.chain), Preprocessing(model=model)
    run = identification_models()[model](robot.chain, base, signals, settings, "exact")
    return Problem(robot.chain, base, (run,), (_measured(signals),), settings, 0.9 * robot.parameters)


def _noisy_problem(robot, encoder, torque, seed=0):
    base = base_parameters(robot.chain)
    settings = Preprocessing(differentiation="butterworth_central")
    motion = _measured(_exact(robot, seed=seed), encoder, torque, seed)
    run = observe(robot.chain, base, motion, settings)
    return Problem(robot.chain, base, (run,), (motion,), settings, 0.9 * robot.parameters)


def _prediction_error(robot, found):
    """RMS torque error over RMS torque, mean over joints, along an exact motion not fitted."""
    problem = _exact_problem(robot, seed=99)
    run = problem.observations[0]
    error = np.sqrt(np.mean(run.residual(found.values) ** 2, axis=0))
    return np.mean(error / np.sqrt(np.mean(run.torque**2, axis=0)))


@pytest.fixture(scope="module")
def exact_problem(robot):
    return _exact_problem(robot)


@pytest.mark.parametrize("name", ESTIMATORS)
def test_exact_signals_return_the_truth(exact_problem, robot, name):
    found = estimate(exact_problem, name)
    truth = found.base.values(robot.parameters)
    assert found.estimator == name
    assert np.abs(found.values - truth).max() < 1e-6 * np.abs(truth).max()


@pytest.mark.parametrize("model", ["energy", "power"])
def test_energy_and_power_balance_return_the_truth(robot, model):
    problem = _exact_problem(robot, model)
    truth = problem.base.values(robot.parameters)
    for name in ("ols", "wls", "irls"):
        found = estimate(problem, name)
        assert np.abs(found.values - truth).max() < 1e-3 * np.abs(truth).max()


@pytest.mark.parametrize("model", ["energy", "power"])
def test_energy_and_power_estimates_are_judged_by_torque(small, model):
    options = IdentificationOptions("wls", preprocessing=Preprocessing(model=model))
    runs = {"a": _measured(_exact(small)), "b": _measured(_exact(small, seed=1))}
    found = identify(small.chain, small.parameters, runs, {"c": runs["b"]}, options)
    assert found.estimate.noise_std.shape == (small.joints,)
    assert found.residual_tests.whiteness.shape == (small.joints,)
    assert found.fits[0].measured.shape[1] == small.joints
    assert found.validations[0].overall_relative < 0.02


def test_an_unknown_model_lists_the_valid_ones(small):
    runs = {"a": _measured(_exact(small))}
    options = IdentificationOptions(preprocessing=Preprocessing(model="momentum"))
    with pytest.raises(InputError, match="valid: energy, inverse_dynamic, power"):
        identify(small.chain, small.parameters, runs, {}, options)


def test_maximum_likelihood_refuses_equations_without_joints(small):
    with pytest.raises(InputError, match="inverse_dynamic"):
        estimate(_exact_problem(small, "energy"), "maximum_likelihood")


def test_encoder_noise_is_read_off_the_positions(robot):
    level = np.linspace(0.5, 2.0, robot.joints) * 1e-4
    motion = _measured(_exact(robot), level)
    # 5000 samples: the deviation of a deviation is 1 %.
    assert position_noise_std(motion, Preprocessing()) == pytest.approx(level, rel=0.04)


def test_noisy_encoders_bias_least_squares_and_not_errors_in_variables(tx90):
    problems = [_noisy_problem(tx90, 10 * ENCODER, 0.01, seed) for seed in range(5)]
    error = {
        name: np.mean([_prediction_error(tx90, estimate(each, name)) for each in problems])
        for name in ("ols", "tls", "maximum_likelihood")
    }
    assert error["tls"] < 0.5 * error["ols"]
    assert error["maximum_likelihood"] < 0.25 * error["ols"]


def test_quiet_encoders_cost_nothing(tx90):
    problem = _noisy_problem(tx90, ENCODER, 0.01)
    reference = _prediction_error(tx90, estimate(problem, "wls"))
    for name in ("tls", "maximum_likelihood"):
        assert _prediction_error(tx90, estimate(problem, name)) < 1.25 * reference


def test_outliers_hardly_move_irls(small):
    problem = _noisy_problem(small, 0.0, 0.01)
    run = problem.observations[0]
    hit = np.random.default_rng(5).random(len(run.torque)) < 0.02
    torque = run.torque + np.where(hit[:, None], 0.5 * np.abs(run.torque).max(axis=0), 0.0)
    spoiled = replace(problem, observations=(replace(run, torque=torque),))
    truth = problem.base.values(small.parameters)
    error = {
        name: np.linalg.norm((estimate(spoiled, name).values - truth) / np.maximum(np.abs(truth), 0.1))
        for name in ("wls", "irls")
    }
    assert error["irls"] < 0.4 * error["wls"]


def test_noise_shared_by_joints_is_weighed_jointly(small):
    problem = _exact_problem(small)
    run = problem.observations[0]
    truth = problem.base.values(small.parameters)
    scores = {"wls": [], "irls": []}
    for seed in range(5):
        rng = np.random.default_rng(seed)
        shared = rng.standard_normal((len(run.torque), 1)) * np.array([3.0, 3.0, 3.0])
        torque = run.torque + shared + 0.3 * rng.standard_normal(run.torque.shape)
        noisy = replace(problem, observations=(replace(run, torque=torque),))
        for name, found in scores.items():
            found.append((estimate(noisy, name).values - truth) / np.maximum(np.abs(truth), 0.1))
    assert np.median(np.abs(scores["irls"])) < 0.6 * np.median(np.abs(scores["wls"]))


def test_a_stream_reaches_the_batch_solution(small):
    problem = _noisy_problem(small, 10 * ENCODER, 0.01)
    online, batch = estimate(problem, "recursive_tls"), estimate(problem, "tls")
    assert np.abs(online.values - batch.values).max() < 0.01 * batch.std.min()


def test_a_stream_says_nothing_before_every_parameter_is_excited():
    stream = RecursiveTotalLeastSquares(np.eye(3))
    for _ in range(9):
        stream.update(np.array([[1.0, 2.0]]), np.array([3.0]))
    assert np.isnan(stream.values).all()
    stream.update(np.array([[1.0, 0.0]]), np.array([1.0]))
    assert stream.values == pytest.approx([1.0, 1.0])


def test_a_forgetting_stream_follows_a_change():
    rng = np.random.default_rng(0)
    stream = RecursiveTotalLeastSquares(np.eye(3), forgetting=0.98)
    for k in range(800):
        truth = np.array([1.0, -2.0]) if k < 400 else np.array([1.5, -1.0])
        rows = rng.standard_normal((2, 2))
        noisy = rows + 0.01 * rng.standard_normal(rows.shape)
        stream.update(noisy, rows @ truth + 0.01 * rng.standard_normal(2))
    # Fifty samples of memory, two rows each: deviation about .01 |(1.5, -1, -1)| / 10.
    assert np.abs(stream.values - truth).max() < 0.01


def _is_consistent(standard):
    table = standard.reshape(-1, PER_JOINT)
    smallest = min(np.linalg.eigvalsh(pseudo_inertia(link[:INERTIAL])).min() for link in table)
    return smallest > 0 and table[:, ARMATURE : COULOMB + 1].min() >= 0


def test_the_consistent_estimate_is_a_robot_that_could_exist(robot):
    problem = _noisy_problem(robot, 10 * ENCODER, 0.2)
    found = estimate(problem, "physically_consistent")
    assert _is_consistent(found.standard)
    assert np.abs(found.base.values(found.standard) - found.values).max() < 1e-9
    # The truth is consistent, so staying among consistent parameters cannot lead away from it.
    assert _prediction_error(robot, found) < _prediction_error(robot, estimate(problem, "wls"))


def test_any_estimate_has_a_consistent_standard_vector(small):
    problem = _noisy_problem(small, ENCODER, 0.01)
    found = estimate(problem, "irls")
    standard = consistent_standard_parameters(found.base, found.values, found.covariance, problem.nominal)
    assert _is_consistent(standard)
    assert np.all(np.abs(found.base.values(standard) - found.values) < 3 * found.std)


@pytest.mark.parametrize("name", ["irls", "maximum_likelihood", "physically_consistent"])
def test_the_same_input_gives_the_same_bits(small, name):
    problem = _noisy_problem(small, 10 * ENCODER, 0.05)
    first, second = estimate(problem, name), estimate(replace(problem), name)
    assert np.array_equal(first.values, second.values)
    assert np.array_equal(first.covariance, second.covariance)
