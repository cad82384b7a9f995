"""Every kind of trajectory: rest at its ends, derivatives that belong together, JSON and back."""

import json

import numpy as np
import pytest

from identification.errors import InputError
from identification.excitation.design import DesignOptions, design_excitation, random_excitation
from identification.excitation.modified_fourier import ModifiedFourierSeries
from identification.excitation.quintic import QuinticPath
from identification.excitation.trajectories import TRAJECTORIES, trajectory_basis, trajectory_from_dict
from testbench.robot import load_robot

FREQUENCY, HARMONICS, JOINTS = 0.2, 5, 3


@pytest.fixture(params=sorted(TRAJECTORIES))
def basis(request):
    return trajectory_basis(request.param, FREQUENCY, HARMONICS)


def random_coefficients(basis, seed=1):
    return np.random.default_rng(seed).normal(size=(basis.size, JOINTS))


def test_motion_starts_and_ends_at_rest_at_one_place(basis):
    trajectory = basis.trajectory(random_coefficients(basis))
    ends = trajectory.evaluate(np.array([0.0, trajectory.duration]))
    # Rounding of sums of terms of order one, and of accelerations of order w² N².
    assert np.abs(np.diff(ends[0], axis=0)).max() < 1e-13
    assert np.abs(ends[1]).max() < 1e-12
    assert np.abs(ends[2]).max() < 1e-11


def test_ends_are_met_from_both_sides_and_every_period(basis):
    trajectory = basis.trajectory(random_coefficients(basis))
    step = 1e-6
    near = np.array([trajectory.duration - step, trajectory.duration + step, 3 * trajectory.duration + step])
    q, dq, ddq = trajectory.evaluate(near)
    start = trajectory.evaluate(np.zeros(1))[0]
    # Jerk of at most some thousand rad/s³.
    assert np.abs(ddq).max() < 1e4 * step
    assert np.abs(dq).max() < 1e4 * step**2
    assert np.abs(q - start).max() < 1e-12


def test_velocity_and_acceleration_are_the_derivatives_of_position(basis):
    trajectory = basis.trajectory(random_coefficients(basis))
    # Off the via points, where the jerk jumps.
    time, step = np.linspace(0.013, trajectory.duration - 0.017, 200), 1e-4
    before, now, after = (trajectory.evaluate(time + shift) for shift in (-step, 0.0, step))
    for order in (0, 1):
        difference = (after[order] - before[order]) / (2 * step)
        scale = np.abs(now[order + 1]).max()
        assert np.abs(difference - now[order + 1]).max() < 1e-5 * scale


def test_basis_is_linear_and_agrees_with_its_trajectory(basis):
    coefficients = random_coefficients(basis)
    time = np.linspace(0.0, 2 / FREQUENCY, 333)
    trajectory = basis.trajectory(coefficients)
    for matrix, exact in zip(basis.matrices(time), trajectory.evaluate(time), strict=True):
        assert matrix.shape == (333, basis.size)
        assert exact.shape == (333, JOINTS)
        assert np.abs(matrix @ coefficients - exact).max() < 1e-11 * max(1.0, np.abs(exact).max())
    assert np.allclose(basis.free_coefficients(trajectory), coefficients, atol=1e-10)
    assert (trajectory.duration, trajectory.joints) == (basis.duration, JOINTS)
    assert trajectory.highest_frequency == pytest.approx(basis.highest_frequency)


def test_free_coefficients_move_alike_and_independently(basis):
    time = np.arange(4000) / (4000 * FREQUENCY)
    velocity = basis.matrices(time)[1][:, 1:]
    gram = velocity.T @ velocity / len(time)
    # Orthogonal, of RMS 1 / sqrt(2), to the error of the coarser grid that made them so.
    assert np.abs(gram - 0.5 * np.eye(basis.size - 1)).max() < 1e-3


def test_first_coefficient_is_the_place_and_scaling_is_about_it(basis):
    coefficients = random_coefficients(basis)
    factors = np.array([0.5, 2.0, 0.0])
    scaled = basis.trajectory(coefficients).scaled(factors)
    expected = np.vstack([coefficients[:1], factors * coefficients[1:]])
    assert np.allclose(basis.free_coefficients(scaled), expected, atol=1e-10)
    still = scaled.evaluate(np.linspace(0, 5, 50))[0][:, 2]
    assert np.all(still == still[0])


def test_json_and_back_is_the_same_motion_to_the_last_bit(basis):
    trajectory = basis.trajectory(random_coefficients(basis))
    again = trajectory_from_dict(json.loads(json.dumps(trajectory.to_dict())))
    assert type(again) is type(trajectory)
    time = np.linspace(0, 7, 100)
    for one, other in zip(trajectory.evaluate(time), again.evaluate(time), strict=True):
        assert np.array_equal(one, other)


def test_modified_series_differs_from_its_fourier_part_by_a_quintic():
    rng = np.random.default_rng(2)
    a, b, start = rng.normal(size=(1, 4)), rng.normal(size=(1, 4)), np.array([0.3])
    series = ModifiedFourierSeries(0.25, start, a, b)
    time = np.linspace(0, 3.999, 500)
    omega = 2 * np.pi * 0.25 * np.arange(1, 5)
    phase = np.outer(time, omega)
    fourier = np.sin(phase) @ (a[0] / omega) - np.cos(phase) @ (b[0] / omega)
    rest = series.evaluate(time)[0][:, 0] - fourier
    fitted = np.polynomial.Polynomial.fit(time, rest, 5)
    assert np.abs(fitted(time) - rest).max() < 1e-11
    assert np.ptp(rest) > 1.0


def test_quintic_takes_the_via_points_and_rest_to_rest_is_the_textbook_polynomial():
    rng = np.random.default_rng(3)
    position, velocity, acceleration = rng.normal(size=(3, 4, 2))
    velocity[0] = acceleration[0] = 0.0
    path = QuinticPath(6.0, position, velocity, acceleration)
    knots = path.evaluate(np.arange(4) * 1.5)
    for found, given in zip(knots, (position, velocity, acceleration), strict=True):
        assert np.allclose(found, given, atol=1e-12)
    zero = np.zeros((4, 2))
    s = np.linspace(0, 1, 50, endpoint=False)
    out = QuinticPath(6.0, position, zero, zero).evaluate(1.5 + 1.5 * s)[0]
    expected = position[1] + np.outer(10 * s**3 - 15 * s**4 + 6 * s**5, position[2] - position[1])
    assert np.allclose(out, expected, atol=1e-12)


def test_sines_are_mirrored_about_half_the_period():
    basis = trajectory_basis("harmonic_sines", FREQUENCY, HARMONICS)
    trajectory = basis.trajectory(random_coefficients(basis))
    time = np.linspace(0, 2.5, 100)
    there = trajectory.evaluate(time)[0] - trajectory.centre
    back = trajectory.evaluate(trajectory.duration - time)[0] - trajectory.centre
    assert np.allclose(there, -back, atol=1e-11)


@pytest.mark.parametrize("name", sorted(TRAJECTORIES))
def test_bases_that_cannot_be_are_refused(name):
    for frequency, harmonics in ((0.0, 5), (np.nan, 5), (np.inf, 5), (0.1, 0)):
        with pytest.raises(InputError, match="expected"):
            trajectory_basis(name, frequency, harmonics)


def test_names_that_do_not_exist_are_refused_with_those_that_do():
    with pytest.raises(InputError, match=r"modified_fourier, quintic"):
        trajectory_basis("spline", 0.1, 5)
    for data in ({"type": "spline"}, {}, None, [1]):
        with pytest.raises(InputError, match="quintic"):
            trajectory_from_dict(data)


def test_damaged_files_are_refused_by_field(basis):
    good = basis.trajectory(random_coefficients(basis)).to_dict()
    for field in good:
        for bad in (None, "x", [[1.0], [2.0, 3.0]], -1.0, [[np.nan]]):
            with pytest.raises(InputError, match="expected"):
                trajectory_from_dict({**good, field: bad})
        with pytest.raises(InputError, match="expected"):
            trajectory_from_dict({key: value for key, value in good.items() if key != field})


@pytest.mark.parametrize(
    ("name", "field", "bad"),
    [
        ("fourier", "a", np.ones((3, 5))),
        ("harmonic_sines", "amplitude", np.ones((3, 5))),
        ("quintic", "velocity", np.ones((5, 3))),
    ],
)
def test_a_file_that_starts_moving_is_refused(name, field, bad):
    basis = trajectory_basis(name, FREQUENCY, HARMONICS)
    good = basis.trajectory(random_coefficients(basis)).to_dict()
    with pytest.raises(InputError, match=field):
        trajectory_from_dict({**good, field: bad.tolist()})


@pytest.mark.parametrize("name", sorted(TRAJECTORIES))
def test_every_kind_is_designed_within_the_limits(name, models):
    arm = load_robot(models / "rail_arm.xml")
    options = DesignOptions(trajectory=name, starts=1, iterations=6, seed=2)
    begin = random_excitation(arm.chain, arm.parameters, arm.limits, options)
    found = design_excitation(arm.chain, arm.parameters, arm.limits, "logdet", options, threads=1)
    assert found.trajectory.to_dict()["type"] == name
    assert begin.margins.kept
    assert found.margins.kept
    assert found.values.logdet < begin.values.logdet
