import dataclasses
import json
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from identification.base_parameters import base_parameters
from identification.errors import InputError
from identification.excitation.constraints import SmoothConstraints
from identification.excitation.criteria import CRITERIA, criterion_values
from identification.excitation.design import DesignOptions, design_excitation, random_excitation
from identification.excitation.excitation import Excitation
from identification.excitation.fourier import FourierBasis, FourierSeries
from identification.excitation.limits import limit_margins, share_of
from identification.excitation.problem import DesignProblem
from testbench.clearance import RobotClearance, robot_clearance
from testbench.excitation_file import excitation_document, read_trajectory, write_excitation
from testbench.robot import Robot, load_robot

MODELS = Path(__file__).parent.parent / "models"
# Few iterations: the tests ask whether a design is right, not how good it gets.
QUICK = DesignOptions(starts=2, iterations=8, seed=3)
STEP = 1e-6


@cache
def robot(name: str) -> Robot:
    return load_robot(MODELS / f"{name}.xml")


@cache
def clearance(name: str) -> RobotClearance:
    found = robot_clearance(robot(name), 0.03)
    assert found is not None
    return found


@cache
def design(criterion: str, threads: int = 1) -> Excitation:
    arm = robot("tx90")
    return design_excitation(
        arm.chain, arm.parameters, arm.limits, criterion, QUICK, clearance("tx90"), threads=threads
    )


def random(name: str, options: DesignOptions = QUICK) -> Excitation:
    arm = robot(name)
    return random_excitation(arm.chain, arm.parameters, arm.limits, options, clearance(name))


def series(seed: int = 0, harmonics: int = 5) -> FourierSeries:
    basis = FourierBasis(0.1, harmonics)
    return basis.trajectory(np.random.default_rng(seed).normal(size=(basis.size, 3)))


@pytest.mark.parametrize("harmonics", [2, 5, 9])
def test_fourier_series_starts_and_ends_at_rest(harmonics):
    motion = series(harmonics=harmonics)
    _, dq, ddq = motion.evaluate(np.array([0.0, motion.duration]))
    # Rounding of sin(2 pi k) over the terms of each sum.
    assert np.abs(dq).max() < 1e-12
    assert np.abs(ddq).max() < 1e-11


def test_fourier_velocity_and_acceleration_are_the_derivatives():
    motion, time = series(), np.linspace(0, 10, 101)
    before, now, after = (motion.evaluate(time + step) for step in (-1e-5, 0.0, 1e-5))
    np.testing.assert_allclose((after[0] - before[0]) / 2e-5, now[1], atol=1e-8)
    np.testing.assert_allclose((after[1] - before[1]) / 2e-5, now[2], atol=1e-8)


def test_fourier_basis_is_linear_and_inverts():
    basis, time = FourierBasis(0.2, 4), np.linspace(0, 5, 37)
    coefficients = np.random.default_rng(1).normal(size=(basis.size, 2))
    motion = basis.trajectory(coefficients)
    for matrix, values in zip(basis.matrices(time), motion.evaluate(time), strict=True):
        np.testing.assert_allclose(matrix @ coefficients, values, atol=1e-12)
    np.testing.assert_allclose(basis.free_coefficients(motion), coefficients, atol=1e-13)


@pytest.mark.parametrize("name", CRITERIA)
def test_criterion_gradient_equals_central_differences(name):
    rng = np.random.default_rng(2)
    matrix, direction = rng.normal(size=(2, 90, 7))
    ends = [CRITERIA[name](matrix + step * direction, 30)[0] for step in (STEP, -STEP)]
    gradient = CRITERIA[name](matrix, 30)[1]
    assert np.sum(gradient * direction) == pytest.approx((ends[0] - ends[1]) / (2 * STEP), rel=1e-6)


@pytest.mark.parametrize("columns", [40, 200])
def test_criteria_are_what_their_names_say(columns):
    matrix = np.random.default_rng(3).normal(size=(3000, columns)) * np.logspace(-2, 2, columns)
    values = criterion_values(matrix, 1000)
    information = matrix.T @ matrix / 1000
    unit = matrix / np.linalg.norm(matrix, axis=0)
    assert values.logdet == pytest.approx(-np.linalg.slogdet(information)[1], rel=1e-9)
    assert values.hadamard == pytest.approx(-np.log(np.diag(information)).sum(), rel=1e-12)
    assert values.condition_number == pytest.approx(np.linalg.cond(unit), rel=1e-9)
    assert values.slack > 0


def test_slack_is_zero_for_orthogonal_columns_and_huge_for_collinear_ones():
    orthogonal = np.linalg.qr(np.random.default_rng(4).normal(size=(50, 6)))[0]
    assert criterion_values(orthogonal, 50).slack == pytest.approx(0, abs=1e-10)
    collinear = np.column_stack([orthogonal, orthogonal[:, 0]])
    assert criterion_values(collinear, 50).slack > 20


@pytest.mark.parametrize("name", ["tx90", "rail_arm"])
def test_design_gradients_equal_central_differences(name):
    arm = robot(name)
    basis = FourierBasis(0.1, 3)
    constraints = SmoothConstraints(arm.chain, arm.parameters, arm.limits, clearance(name))
    columns = base_parameters(arm.chain).columns
    problem = DesignProblem(arm.chain, basis, columns, arm.limits.torque, CRITERIA["logdet"], constraints)
    rng = np.random.default_rng(5)
    start = basis.free_coefficients(random(name, dataclasses.replace(QUICK, harmonics=3)).trajectory)
    z = problem.variables(start) + 0.01 * rng.normal(size=start.size)
    for direction in rng.normal(size=(3, z.size)):
        forward, backward = z + STEP * direction, z - STEP * direction
        slope = (problem.value(forward) - problem.value(backward)) / (2 * STEP)
        assert problem.gradient(z) @ direction == pytest.approx(slope, rel=1e-6)
        slopes = (problem.constraint_values(forward) - problem.constraint_values(backward)) / (2 * STEP)
        np.testing.assert_allclose(problem.constraint_gradients(z) @ direction, slopes, rtol=1e-5, atol=1e-6)


def test_smooth_constraints_never_promise_more_than_is_left():
    arm = robot("tx90")
    motion = random("tx90").trajectory.evaluate(np.linspace(0, 10, 200))
    values = SmoothConstraints(arm.chain, arm.parameters, arm.limits, None).values(*motion)
    speeds = 1 - np.abs(motion[1]).max(axis=0) / arm.limits.velocity
    assert np.all(values[6:12] <= speeds)
    # The bound of Kreisselmeier-Steinhauser: log of twice the samples, over the sharpness.
    assert np.all(values[6:12] >= speeds - np.log(400) / 150)


@pytest.mark.parametrize("criterion", CRITERIA)
def test_design_improves_its_criterion_and_keeps_every_limit(criterion):
    found = design(criterion)
    arm = robot("tx90")
    begin = random("tx90")
    value = {"condition": "condition_number"}.get(criterion, criterion)
    assert getattr(found.values, value) < getattr(begin.values, value)
    assert found.margins.kept
    margins = limit_margins(arm.chain, arm.parameters, arm.limits, found.trajectory, clearance("tx90"))
    assert margins.clearance == found.margins.clearance
    # The optimiser was given 95 % of the limits.
    assert np.all(found.margins.velocity >= 0.05 * arm.limits.velocity - 1e-9)
    assert np.all(found.margins.torque >= 0.05 * arm.limits.torque - 1e-9)


def test_design_repeats_whatever_the_number_of_threads():
    assert excitation_document(design("hadamard", 1)) == excitation_document(design("hadamard", 2))


def test_random_excitation_keeps_the_limits_of_an_arm_with_a_slide_joint():
    found = random("rail_arm")
    assert found.margins.kept
    assert found.criterion is None
    other = random("rail_arm", dataclasses.replace(QUICK, seed=4))
    assert not np.allclose(found.trajectory.centre, other.trajectory.centre)


def test_progress_counts_iterations_of_every_start():
    arm = robot("tx90")
    seen = []
    options = DesignOptions(starts=2, iterations=3)
    design_excitation(
        arm.chain, arm.parameters, arm.limits, "hadamard", options, progress=seen.append, threads=1
    )
    assert [(p.start, p.iteration) for p in seen] == [(s, i) for s in (0, 1) for i in (1, 2, 3)]


def changed_limits(**changes: tuple[int, float]):
    """The TX-90's limits with one joint's value changed in each of the named arrays."""
    limits = robot("tx90").limits
    arrays = {name: getattr(limits, name).copy() for name in changes}
    for name, (joint, value) in changes.items():
        arrays[name][joint] = value
    return dataclasses.replace(limits, **arrays)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"torque": (1, 30.0)}, r"torque limit of joint_2 .*: expected at least 3\d.*got 28.5"),
        ({"upper": (0, np.inf)}, r"position range of joint_1: expected finite"),
        ({"velocity": (3, -1.0)}, r"velocity limit of joint_4: expected a positive number, got -1"),
        ({"torque": (2, np.inf), "velocity": (2, np.inf)}, r"torque limit of joint_3: expected a finite"),
    ],
)
def test_limits_that_cannot_be_met_are_named(changes, words):
    arm = robot("tx90")
    with pytest.raises(InputError, match=words):
        design_excitation(arm.chain, arm.parameters, changed_limits(**changes), options=QUICK)


def test_clearance_that_cannot_be_met_names_the_pair():
    arm = robot("tx90")
    far = dataclasses.replace(clearance("tx90"), required=1.0)
    with pytest.raises(InputError, match=r"clearance of \w+ and collision_\w+: expected at most .* got 1 m"):
        random_excitation(arm.chain, arm.parameters, arm.limits, QUICK, far)


def test_velocity_and_acceleration_limits_may_be_missing():
    arm = robot("tx90")
    nothing = np.full(6, np.inf)
    limits = dataclasses.replace(arm.limits, velocity=nothing, acceleration=nothing)
    found = design_excitation(arm.chain, arm.parameters, limits, options=QUICK)
    assert found.margins.kept
    assert np.all(np.isinf(found.margins.velocity))


def test_unknown_criterion_is_named_with_the_known_ones():
    arm = robot("tx90")
    with pytest.raises(InputError, match="hadamard, condition, logdet"):
        design_excitation(arm.chain, arm.parameters, arm.limits, "best")


def test_share_of_limits_shrinks_ranges_about_their_middle():
    limits = robot("tx90").limits
    half = share_of(limits, 0.5)
    np.testing.assert_allclose(half.upper + half.lower, limits.upper + limits.lower)
    np.testing.assert_allclose(half.upper - half.lower, (limits.upper - limits.lower) / 2)


@pytest.mark.parametrize("name", ["tx90", "rail_arm"])
def test_clearance_gradient_equals_central_differences(name):
    arm, distance = robot(name), clearance(name)
    rng = np.random.default_rng(6)
    q = rng.uniform(arm.limits.lower, arm.limits.upper, (200, arm.joints))
    distances, gradients = distance.gradients(q)
    np.testing.assert_array_equal(distances, distance.distances(q))
    near = (distances < distance.required + 0.14) & (distances > 1e-3)
    assert near.sum() > 100
    differences = np.empty(gradients.shape)
    for joint in range(arm.joints):
        ends = [q.copy(), q.copy()]
        ends[0][:, joint] += STEP
        ends[1][:, joint] -= STEP
        differences[:, :, joint] = (distance.distances(ends[0]) - distance.distances(ends[1])) / (2 * STEP)
    errors = np.abs(gradients - differences).max(axis=2)[near]
    # A distance has kinks where the closest points change sides; they are met by chance only.
    assert np.quantile(errors, 0.98) < 1e-6


def test_excitation_file_reads_back_the_same_motion(tmp_path):
    found = random("tx90")
    write_excitation(found, tmp_path / "excitation.json")
    names, trajectory = read_trajectory(tmp_path / "excitation.json")
    assert names == robot("tx90").joint_names
    time = np.linspace(0, 10, 50)
    assert np.array_equal(trajectory.evaluate(time), found.trajectory.evaluate(time))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"trajectory": {"type": "spline"}}, "type: expected a known trajectory type, got 'spline'"),
        ({"joint_names": ["a"]}, "trajectory: expected 1 joints"),
        ({"format_version": 9}, "format: expected excitation, version 1, got excitation, version 9"),
        ({"joint_names": 3}, "joint_names: expected a list"),
    ],
)
def test_broken_excitation_file_is_one_clear_line(tmp_path, change, words):
    path = tmp_path / "broken.json"
    path.write_text(json.dumps(json.loads(json.dumps(excitation_document(random("tx90")))) | change))
    with pytest.raises(InputError, match=words) as caught:
        read_trajectory(path)
    assert str(path) in str(caught.value)


@pytest.mark.parametrize(
    ("key", "value", "words"),
    [
        ("base_frequency", -0.1, "base_frequency: expected a positive number"),
        ("a", [[1.0, 2.0]], "a: expected"),
        ("centre", [0.0, float("nan"), 0.0], "centre: expected a list of numbers"),
        ("b", None, "b: expected a list of rows"),
    ],
)
def test_broken_fourier_series_is_named(key, value, words):
    data = series().to_dict()
    data[key] = value
    with pytest.raises(InputError, match=words):
        FourierSeries.from_dict(data)


def test_fourier_series_that_starts_moving_is_refused():
    data = series().to_dict()
    data["a"][0][0] += 0.1
    with pytest.raises(InputError, match="start at rest"):
        FourierSeries.from_dict(data)
