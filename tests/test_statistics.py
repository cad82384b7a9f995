"""Residual statistics against their own promises: false alarms, power, and coverage over seeds."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.stats import binom

from identification.base_parameters import base_parameters
from identification.estimators import estimate
from identification.filtering import zero_phase_lowpass
from identification.inverse_dynamics import inverse_dynamics
from identification.models import Preprocessing, observe
from identification.problem import Problem
from identification.signals import Motion
from identification.statistics import essential_parameters, least_certain, residual_tests

from .synthetic import synthetic_robot

RATE = 500.0
SEEDS = 24
FEW = 12


@pytest.fixture(scope="module")
def robot(tmp_path_factory):
    """Two hinges and a slide."""
    return synthetic_robot(tmp_path_factory.mktemp("model"))


@pytest.fixture(scope="module")
def clean(robot):
    """A problem without noise, filtered by the pipeline, whose torque noise is added afterwards."""
    time = np.arange(0, 12.0, 1 / RATE)[:, None]
    rng = np.random.default_rng(0)
    q, dq, ddq = np.zeros((3, len(time), robot.joints))
    for w in 2 * np.pi * np.array([0.13, 0.29, 0.41, 0.53, 0.71]):
        a, angle = rng.uniform(0.05, 0.2, robot.joints), w * time + rng.uniform(0, 6, robot.joints)
        q, dq, ddq = q + a * np.sin(angle), dq + a * w * np.cos(angle), ddq - a * w**2 * np.sin(angle)
    torque = inverse_dynamics(robot.chain, robot.parameters, q, dq, ddq)
    settings = Preprocessing(differentiation="butterworth_central", dead_zone=0.02)
    base, motion = base_parameters(robot.chain), Motion(q, torque, RATE)
    run = observe(robot.chain, base, motion, settings)
    exact = replace(run, torque=run.regressor @ base.values(robot.parameters))
    return Problem(robot.chain, base, (exact,), (motion,), settings, 0.9 * robot.parameters)


def _with_noise(problem, seed, pole=0.0, draw=np.random.Generator.standard_normal):
    """White noise through the pipeline's low-pass, or first-order noise instead."""
    rng = np.random.default_rng(seed)
    motion = problem.motions[0]
    level = 0.02 * np.sqrt(np.mean(motion.torque**2, axis=0))
    noise = level * draw(rng, size=motion.torque.shape)
    noise = lfilter([1.0], [1.0, -pole], noise, axis=0)
    run = problem.observations[0]
    kept = np.round(run.time * RATE).astype(int)
    filtered = zero_phase_lowpass(noise, RATE, problem.preprocessing.cutoff)[kept]
    return replace(problem, observations=(replace(run, torque=run.torque + filtered),))


@pytest.mark.parametrize(("name", "pole"), [("wls", 0.0), ("wls", 0.98), ("irls", 0.0), ("ols", 0.0)])
def test_stated_intervals_cover_the_truth(clean, robot, name, pole):
    truth = clean.base.values(robot.parameters)
    inside = np.zeros(clean.base.count)
    for seed in range(SEEDS):
        found = estimate(_with_noise(clean, seed, pole), name)
        inside += np.abs(found.values - truth) < 1.96 * found.std
    # A 95 % interval that covers fewer than this of 24 times happens once in 1000 over all parameters.
    least = binom.ppf(1e-3 / clean.base.count, SEEDS, 0.95)
    assert inside.min() >= least
    # Intervals so wide that they never miss are no better: all together would miss 1 time in 20.
    assert inside.sum() < SEEDS * clean.base.count


def test_white_noise_seldom_raises_an_alarm_and_coloured_does(clean):
    white, coloured = [], []
    for seed in range(FEW):
        for pole, p_values in ((0.0, white), (0.99, coloured)):
            problem = _with_noise(clean, seed, pole)
            p_values.append(residual_tests(problem, estimate(problem, "wls")).whiteness)
    tests = np.size(white)
    assert np.count_nonzero(np.array(white) < 0.05) <= binom.ppf(0.999, tests, 0.08)
    assert np.mean(np.array(coloured) < 0.05) > 0.9


def test_normality_holds_for_normal_noise_and_fails_for_bursts(clean):
    def bursts(rng, size):
        return (
            rng.standard_normal(size)
            * np.where(rng.random((size[0] // 50 + 1, 1)) < 0.05, 12, 1).repeat(50, axis=0)[: size[0]]
        )

    normal, heavy = [], []
    for seed in range(FEW):
        for draw, p_values in ((np.random.Generator.standard_normal, normal), (bursts, heavy)):
            problem = _with_noise(clean, seed, draw=draw)
            p_values.append(residual_tests(problem, estimate(problem, "wls")).normality)
    assert np.count_nonzero(np.array(normal) < 0.05) <= binom.ppf(0.999, np.size(normal), 0.06)
    assert np.mean(np.array(heavy) < 0.05) > 0.9


def test_effective_samples_shrink_with_colour(clean):
    white, coloured = (_with_noise(clean, 1, pole) for pole in (0.0, 0.98))
    few = residual_tests(coloured, estimate(coloured, "wls")).independent_samples
    many = residual_tests(white, estimate(white, "wls")).independent_samples
    assert np.all(few < 0.8 * many)


def test_parameters_without_effect_are_dropped_and_the_rest_kept(clean, robot):
    truth = clean.base.values(robot.parameters)
    problem = _with_noise(clean, 3)
    found = estimate(problem, "wls")
    essential = essential_parameters(problem, found)
    assert sorted([*essential.kept, *essential.dropped]) == list(range(clean.base.count))
    assert essential.p_value > 0.05
    assert np.all(essential.values[list(essential.dropped)] == 0)
    score = np.abs(truth) / found.std
    # What stands out by six deviations stays; what is zero goes, but for one chance in twenty each.
    assert set(np.flatnonzero(score > 6)) <= set(essential.kept)
    zeros = np.flatnonzero(score < 0.1)
    assert len(zeros) > 0
    assert len(set(zeros) & set(essential.kept)) <= 1
    kept = essential.kept
    assert np.all(essential.std[kept] <= 1.1 * found.std[kept])


def test_dropping_keeps_its_promise_over_seeds(clean, robot):
    truth = clean.base.values(robot.parameters)
    lost = 0
    for seed in range(FEW):
        problem = _with_noise(clean, seed)
        found = estimate(problem, "wls")
        dropped = list(essential_parameters(problem, found).dropped)
        lost += np.count_nonzero(np.abs(truth[dropped]) > 6 * found.std[dropped])
    assert lost == 0


def test_samples_are_counted_in_these_equations_whatever_the_estimator_counted(clean):
    problem = _with_noise(clean, 2)
    found = estimate(problem, "wls")
    elsewhere = replace(found, effective_samples=1.0)
    one, other = (essential_parameters(problem, each) for each in (found, elsewhere))
    assert np.array_equal(one.kept, other.kept)
    assert one.p_value == other.p_value


def test_a_stricter_test_keeps_more(clean):
    problem = _with_noise(clean, 2)
    found = estimate(problem, "wls")
    kept = [len(essential_parameters(problem, found, level).kept) for level in (0.001, 0.05, 0.5)]
    assert kept == sorted(kept)


@pytest.mark.filterwarnings("error::RuntimeWarning")
def test_a_value_of_exactly_zero_is_the_least_certain():
    assert least_certain(np.array([3.0, 1e-12, -5.0]), np.array([1.0, 1e-10, 1.0])) == 1
    assert least_certain(np.array([3.0, 1e-12, 0.0]), np.array([1.0, 1e-12, 20.0])) == 2
    assert least_certain(np.zeros(2), np.zeros(2)) == 0
