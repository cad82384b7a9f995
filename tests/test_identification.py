"""The pipeline on equations whose solution is known, without a simulator."""

import numpy as np
import pytest

from identification.base_parameters import base_parameters
from identification.covariance import variance_inflation
from identification.errors import InputError
from identification.estimators import estimate
from identification.models import Observations, Preprocessing, observe
from identification.parameters import DEFAULT_GROUPS, GROUPS
from identification.pipeline import IdentificationOptions, identify
from identification.problem import Problem
from identification.regressor import regressor
from identification.signals import Motion
from testbench.robot import load_robot

RATE = 500.0


@pytest.fixture(scope="module")
def robot(models):
    return load_robot(models / "tx90.xml")


def _wave(robot, seconds=12.0, seed=0):
    """A smooth random motion: q, dq, ddq (N, n) in closed form."""
    rng = np.random.default_rng(seed)
    time = np.arange(0, seconds, 1 / RATE)
    q = np.zeros((len(time), robot.joints))
    dq, ddq = np.zeros_like(q), np.zeros_like(q)
    for w in 2 * np.pi * np.array([0.13, 0.29, 0.41, 0.53, 0.71]):
        a, phase = rng.uniform(0.1, 0.4, robot.joints), rng.uniform(0, 2 * np.pi, robot.joints)
        angle = w * time[:, None] + phase
        q += a * np.sin(angle)
        dq += a * w * np.cos(angle)
        ddq -= a * w**2 * np.sin(angle)
    return q, dq, ddq


def _exact_problem(robot, base, noise=None, seed=0):
    q, dq, ddq = _wave(robot, seed=seed)
    rows = regressor(robot.chain, q, dq, ddq, base.columns)
    torque = rows @ base.values(robot.parameters)
    if noise is not None:
        torque = torque + noise * np.random.default_rng(100 + seed).normal(size=torque.shape)
    used = np.ones(torque.shape, dtype=bool)
    run = Observations(f"run_{seed}", np.arange(len(q)) / RATE, q, dq, rows, torque, used, RATE)
    return Problem(
        robot.chain, base, (run,), (Motion(q, torque, RATE),), Preprocessing(), nominal=0.9 * robot.parameters
    )


@pytest.mark.parametrize("name", ["ols", "wls"])
def test_exact_data_returns_the_truth(robot, name):
    base = base_parameters(robot.chain)
    problem = _exact_problem(robot, base)
    found = estimate(problem, name)
    truth = base.values(robot.parameters)
    assert np.abs(found.values - truth).max() < 1e-6 * np.abs(truth).max()


def test_stated_deviations_cover_the_truth_at_unequal_noise(robot):
    base = base_parameters(robot.chain)
    truth = base.values(robot.parameters)
    noise = 0.01 * robot.limits.torque
    scores = []
    for seed in range(12):
        problem = _exact_problem(robot, base, noise, seed)
        found = estimate(problem, "wls")
        scores.append((found.values - truth) / found.std)
    spread = np.std(scores)
    # 12 x 52 scores, correlated within a seed; an honest deviation gives 1 within this.
    assert 0.85 < spread < 1.15


def test_weights_beat_equal_rows_where_noise_differs_between_joints(robot):
    base = base_parameters(robot.chain)
    problem = _exact_problem(robot, base, 0.01 * robot.limits.torque)
    ordinary, weighted = estimate(problem, "ols"), estimate(problem, "wls")
    assert np.median(weighted.std / ordinary.std) < 0.5


def test_coloured_residuals_count_for_less():
    rng = np.random.default_rng(3)
    pole, samples = 0.9, 40_000
    shocks = rng.normal(size=samples)
    coloured = np.empty(samples)
    coloured[0] = shocks[0] / np.sqrt(1 - pole**2)
    for k in range(1, samples):
        coloured[k] = pole * coloured[k - 1] + shocks[k]
    both = np.column_stack([coloured, shocks])
    variance, inflation = variance_inflation([both], [np.ones(both.shape, dtype=bool)])
    assert variance == pytest.approx([1 / (1 - pole**2), 1.0], rel=0.1)
    # Theory: (1 + pole) / (1 - pole) = 19.
    assert inflation == pytest.approx([19.0, 1.0], rel=0.2)


def test_filtering_regressor_and_torque_alike_adds_no_bias(robot):
    q, dq, ddq = _wave(robot)
    tau = regressor(robot.chain, q, dq, ddq) @ robot.parameters
    motion = Motion(q, tau, RATE)
    options = IdentificationOptions(preprocessing=Preprocessing(differentiation="butterworth_central"))
    found = identify(robot.chain, robot.parameters, {"run": motion}, {}, options)
    truth = found.estimate.base.values(robot.parameters)
    assert np.abs(found.estimate.values - truth).max() < 2e-3 * np.abs(truth).max()
    assert found.fits[0].overall_relative < 2e-3


def test_a_joint_that_rests_has_no_usable_friction_rows(robot):
    q, _, _ = _wave(robot)
    q[:, 2] = 0.3
    base = base_parameters(robot.chain)
    run = observe(robot.chain, base, Motion(q, np.zeros_like(q), RATE), Preprocessing())
    assert not run.used[:, 2].any()
    assert run.used[:, 1].any()


def test_a_motion_that_excites_nothing_is_refused_by_name(robot):
    q, _, _ = _wave(robot)
    q[:, 3] = 0.1
    with pytest.raises(InputError, match="nothing that reveals .*joint_4"):
        identify(
            robot.chain,
            robot.parameters,
            {"run": Motion(q, np.zeros_like(q), RATE)},
            {},
            IdentificationOptions(),
        )


def test_standing_still_is_refused(robot):
    rest = np.zeros((5000, robot.joints))
    with pytest.raises(InputError, match="outside the dead zone"):
        identify(
            robot.chain, robot.parameters, {"run": Motion(rest, rest, RATE)}, {}, IdentificationOptions()
        )


def test_unknown_names_list_the_valid_ones(robot):
    q, _, _ = _wave(robot)
    runs = {"run": Motion(q, q, RATE)}
    with pytest.raises(InputError, match="valid: .*ols.*wls"):
        identify(robot.chain, robot.parameters, runs, {}, IdentificationOptions(estimator="best"))
    with pytest.raises(InputError, match="valid: .*rloess"):
        identify(
            robot.chain,
            robot.parameters,
            runs,
            {},
            IdentificationOptions(preprocessing=Preprocessing(differentiation="magic")),
        )
    with pytest.raises(InputError, match="valid: .*coulomb"):
        identify(robot.chain, robot.parameters, runs, {}, IdentificationOptions(groups=("stiction",)))


def test_base_values_predict_what_standard_values_do(robot):
    q, dq, ddq = (x[:200] for x in _wave(robot))
    for groups in (DEFAULT_GROUPS, tuple(GROUPS), ("inertial",)):
        base = base_parameters(robot.chain, groups)
        chosen = np.zeros_like(robot.parameters)
        columns = [14 * j + k for j in range(robot.joints) for g in groups for k in GROUPS[g]]
        chosen[columns] = robot.parameters[columns]
        full = regressor(robot.chain, q, dq, ddq) @ chosen
        short = regressor(robot.chain, q, dq, ddq, base.columns) @ base.values(chosen)
        assert np.abs(full - short).max() < 1e-9


def test_regressor_does_not_depend_on_threads(robot):
    q, dq, ddq = _wave(robot)
    one = regressor(robot.chain, q, dq, ddq, threads=1)
    assert np.array_equal(one, regressor(robot.chain, q, dq, ddq, threads=3))
