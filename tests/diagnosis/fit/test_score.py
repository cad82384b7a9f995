"""Weighing all candidates at once by the Schur complement gives what solving each hypothesis anew gives."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from diagnosis.data.preparation import prepare
from diagnosis.fit.bounded import solve
from diagnosis.fit.normal_equations import fitted_to, squares
from diagnosis.fit.score import Stage
from diagnosis.model.base_regressor import BaseRegressor
from diagnosis.model.candidates import candidates
from diagnosis.model.gram import Bank
from diagnosis.model.hypothesis import scaled_precision
from identification.inverse_dynamics import inverse_dynamics
from testbench.effects import parse_injection

from ...diagnosed import simulated_runs
from ...small_arm import small_arm

EFFECTS = ("stribeck_friction", "load_dependent_friction", "encoder_offset", "cable_spring")


@pytest.fixture(scope="module")
def stage(tmp_path_factory):
    arm = small_arm(tmp_path_factory.mktemp("arm"))
    fault = parse_injection(arm, "stribeck_friction:shoulder:extra=1.2,velocity=0.2")
    prepared = prepare(arm, simulated_runs(arm, [fault], runs=3))
    return Stage.of(BaseRegressor(prepared), [])


def base_rows(base, fold, joint):
    """A joint's rows of the base regressor, (m, p): zero for what does not load it."""
    x = base.x(fold, joint)
    whole = np.zeros((len(x), base.parameters))
    whole[:, base.loading[joint]] = x
    return whole


def solved(stage, candidate, folds):
    """Coefficients of everything, fitted to some folds with the stage's weights and prior; its objective."""
    base = stage.base
    rows, right = [], []
    for f in folds:
        for j in range(base.joints):
            root = np.sqrt(stage.weights[j])
            z = base.rows_of(candidate.columns, f, j) if candidate else np.zeros((len(base.y[f][j]), 0))
            rows.append(root * np.hstack([base_rows(base, f, j), z]))
            right.append(root * base.y[f][j])
    count = candidate.count if candidate else 0
    prior = np.diag(np.sqrt(scaled_precision(stage.hypothesis, stage.fitted.prior_scales)))
    rows.append(np.hstack([prior, np.zeros((len(prior), count))]))
    right.append(np.zeros(len(prior)))
    matrix, target = np.vstack(rows), np.concatenate(right)
    scale = 1 / np.linalg.norm(matrix, axis=0)
    free = np.full(len(prior), np.inf)
    lower = np.concatenate([-free, candidate.bounds[0] if candidate else []]) / scale
    upper = np.concatenate([free, candidate.bounds[1] if candidate else []]) / scale
    found = lsq_linear(matrix * scale, target, (lower, upper), method="bvls", tol=1e-14)
    return found.x * scale, 2 * found.cost


def held_out(stage, candidate):
    """Squared residual of each joint, every fold predicted from the others, (n,)."""
    base = stage.base
    total = np.zeros(base.joints)
    for f in range(len(base.folds)):
        values, _ = solved(stage, candidate, [other for other in range(len(base.folds)) if other != f])
        for j in range(base.joints):
            rows = base_rows(base, f, j)
            if candidate:
                rows = np.hstack([rows, base.rows_of(candidate.columns, f, j)])
            total[j] += np.sum((base.y[f][j] - rows @ values) ** 2)
    return total


def test_rows_of_what_loads_a_joint_give_all_of_the_torque_by_the_model(stage):
    nominal = stage.prepared.nominal
    for run in stage.prepared.runs:
        logged = run.logged
        torque = inverse_dynamics(logged.chain, nominal, logged.q, logged.dq, logged.ddq)
        expected = run.filtered(torque, range(stage.base.joints))
        np.testing.assert_allclose(run.by_model(nominal), expected, atol=1e-9 * np.abs(expected).max())


def test_gains_are_those_of_solving_each_hypothesis(stage):
    proposals = [c for c in candidates(stage.prepared, only=EFFECTS) if c.family.joint == 0]
    gains = stage.gains(Bank(stage.base, proposals))
    _, before = solved(stage, None, range(len(stage.base.folds)))
    left = held_out(stage, None)
    assert len(gains) > len(EFFECTS)
    for gain in gains:
        assert gain is not None
        _, after = solved(stage, gain.candidate, range(len(stage.base.folds)))
        assert gain.objective == pytest.approx(before - after, rel=1e-3, abs=1e-3 * before)
        np.testing.assert_allclose(
            gain.held_out, left - held_out(stage, gain.candidate), rtol=0, atol=2e-3 * left.max()
        )


def test_rivals_are_compared_by_the_weights_and_the_prior_of_one_stage(stage):
    proposals = candidates(stage.prepared, only=["load_dependent_friction", "cable_spring"])
    for candidate in proposals:
        gain, (_, compared) = stage.gain(candidate), stage.compared(candidate)
        assert np.array_equal(compared.weights, stage.weights)
        np.testing.assert_array_equal(compared.prior_scales, stage.fitted.prior_scales)
        # What was weighed at once is what the fit has.
        assert stage.held_squares - squares(compared.held_out) == pytest.approx(
            gain.held_out, abs=1e-4 * stage.held_squares.max()
        )


@pytest.mark.parametrize("place", range(3))
def test_gains_beside_what_is_at_a_bound_are_those_of_solving_anew(stage, place):
    # Bounds that some folds' coefficients would pass, if not that of all runs.
    (bounded, *_), others = (
        candidates(stage.prepared, only=[name]) for name in ("stribeck_friction", "load_dependent_friction")
    )
    free = np.sort(fitted_to(stage.base, [bounded])[1].apart[:, -1])
    upper = np.mean([free[place], free[place - 1] if place else 0.0], keepdims=True)
    bounded = replace(bounded, member=replace(bounded.member, upper=upper))
    beside = Stage.of(stage.base, [bounded])
    assert np.sum(beside.fitted.apart[:, -1] > (1 - 1e-9) * upper) == len(free) - place
    for candidate in others:
        gain, (_, compared) = beside.gain(candidate), beside.compared(candidate)
        assert beside.held_squares - squares(compared.held_out) == pytest.approx(
            gain.held_out, abs=1e-6 * beside.held_squares.max()
        )
        assert beside.fitted.objective - compared.objective == pytest.approx(gain.objective, rel=1e-6)


def test_a_direction_whose_information_was_subtracted_but_for_rounding_is_left_alone():
    rng = np.random.default_rng(0)
    rows = rng.standard_normal((50, 4))
    matrix = rows.T @ rows
    # The last two unknowns are one, and what is left of their difference is rounding of the wrong sign.
    matrix[:, 3] = matrix[:, 2]
    matrix[3, :] = matrix[2, :]
    matrix[3, 3] = matrix[2, 2] * (1 - 1e-11)
    free = np.full(4, np.inf)
    found = solve(matrix, matrix @ [1.0, 2.0, 3.0, 0.0], -free, free)
    assert found[:2] == pytest.approx([1.0, 2.0], abs=1e-4)
    assert found[2] + found[3] == pytest.approx(3.0, abs=1e-4)


def test_an_unknown_that_no_row_is_left_of_stays_at_zero_whatever_rounding_says():
    matrix, free = np.diag([4.0, 2.0, -5e-9]), np.full(3, np.inf)
    matrix[0, 2] = matrix[2, 0] = 3.0
    assert solve(matrix, np.array([8.0, 2.0, 1.0]), -free, free) == pytest.approx([2.0, 1.0, 0.0])


def test_an_unknown_whose_bounds_are_one_value_is_that_value():
    rng = np.random.default_rng(3)
    root = rng.normal(size=(6, 4))
    matrix, right = root.T @ root, rng.normal(size=4)
    lower = np.array([-np.inf, 0.5, 0.0, -np.inf])
    upper = np.array([np.inf, 0.5, 0.0, 0.1])
    found = solve(matrix, right, lower, upper)
    assert found[1:3].tolist() == [0.5, 0.0]
    # The gradient vanishes along what is free and not at a bound.
    gradient = matrix @ found - right
    assert abs(gradient[0]) < 1e-9
    assert found[3] <= 0.1
    assert gradient[3] <= 1e-9
