"""The band of each joint: as wide as its encoders' noise leaves."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis.data.decimation import decimating_filters, filtered, filtered_in_parts, filtered_windows
from identification.band import NOISE, joint_bands, position_noise
from identification.inverse_dynamics import inverse_dynamics
from identification.signals import Motion
from testbench.effects.columns import AT_ONCE, Window, WindowedColumns
from testbench.robot import Robot
from testbench.sampling import motion

from .diagnosed import simulated_runs
from .small_arm import small_arm

RATE = 500.0


@pytest.fixture(scope="module")
def robot(tmp_path_factory: pytest.TempPathFactory) -> Robot:
    return small_arm(tmp_path_factory.mktemp("robot"))


@pytest.fixture(scope="module")
def smooth(robot: Robot) -> Motion:
    """Sines of the arm's joints, without noise."""
    time = np.arange(int(40 * RATE)) / RATE
    turns = 2 * np.pi * np.arange(1, robot.joints + 1) * 0.3
    q, dq, ddq = (amplitude * np.sin(turns * time[:, None] + phase) for amplitude, phase in (
        (np.ones_like(turns), 0.0), (turns, np.pi / 2), (turns**2, np.pi)
    ))  # fmt: skip
    return Motion(q, inverse_dynamics(robot.chain, robot.parameters, q, dq, ddq), RATE)


def noisy(smooth: Motion, deviation: float, seed: int = 0) -> Motion:
    noise = deviation * np.random.default_rng(seed).standard_normal(smooth.position.shape)
    return replace(smooth, position=smooth.position + noise)


def test_the_density_of_white_position_noise_is_read_beside_the_motion(smooth: Motion) -> None:
    deviation = 1e-5
    expected = 2 * deviation**2 / RATE
    # 156 half-overlapping segments, 52 lines: a median of medians is known to 3 %.
    np.testing.assert_allclose(position_noise(noisy(smooth, deviation)), expected, rtol=0.09)


def test_a_run_of_a_few_samples_tells_nothing_of_noise(smooth: Motion) -> None:
    short = replace(smooth, position=smooth.position[:5], torque=smooth.torque[:5])
    np.testing.assert_array_equal(position_noise(short), 0.0)


def test_without_noise_the_band_is_the_widest(robot: Robot, smooth: Motion) -> None:
    np.testing.assert_array_equal(joint_bands(robot.chain, robot.parameters, [smooth], 20.0).cutoff, 20.0)


def test_behind_its_band_a_joints_torque_is_as_noisy_as_allowed(robot: Robot, smooth: Motion) -> None:
    """The formula's band is ideal; the low-pass's skirts let up to a third more in."""
    deviation = 2e-4
    bands = joint_bands(robot.chain, robot.parameters, [noisy(smooth, deviation)], 60.0)
    assert np.all((bands.cutoff > 8.0) & (bands.cutoff < 60.0))
    # Second differences of the noise alone through the inertia at the poses of the motion.
    noise = noisy(smooth, deviation).position - smooth.position
    acceleration = np.gradient(np.gradient(noise, 1 / RATE, axis=0), 1 / RATE, axis=0)
    still = np.zeros_like(noise)
    torque, rest = (
        inverse_dynamics(robot.chain, robot.parameters, smooth.position, still, ddq)
        for ddq in (acceleration, still)
    )
    for joint, low_pass in enumerate(decimating_filters(RATE, bands.cutoff)):
        left = np.sqrt(np.mean(low_pass((torque - rest)[:, joint]) ** 2))
        allowed = NOISE * np.sqrt(np.mean(smooth.torque[:, joint] ** 2))
        assert 0.75 < left / allowed < 1.33
        assert bands.encoder_torque[joint] == pytest.approx(allowed, rel=0.01)


def test_what_encoders_seem_to_add_is_reported_where_the_band_is_the_widest_too(
    robot: Robot, smooth: Motion
) -> None:
    quiet, loud = (
        joint_bands(robot.chain, robot.parameters, [noisy(smooth, deviation)], 20.0)
        for deviation in (5e-6, 1.5e-5)
    )
    np.testing.assert_array_equal(loud.cutoff, 20.0)
    np.testing.assert_allclose(loud.encoder_torque, 3 * quiet.encoder_torque, rtol=0.1)


def test_filters_of_several_bands_keep_the_same_samples() -> None:
    filters = decimating_filters(RATE, np.array([20.0, 8.0, 20.0]))
    assert filters[0] is filters[2]
    assert filters[0].step == filters[1].step
    constant = np.ones(2000)
    for low_pass in filters:
        np.testing.assert_array_equal(low_pass.kept(2000), filters[1].kept(2000))
        np.testing.assert_allclose(low_pass(constant), 1.0, rtol=1e-12)


@pytest.mark.parametrize(("first", "length"), [(0, 30), (700, 60), (1970, 30), (1999, 1), (0, 2000), (5, 0)])
def test_what_is_zero_but_in_a_window_is_filtered_like_anything_else(first: int, length: int) -> None:
    filters = decimating_filters(RATE, np.array([20.0, 8.0]))
    window = Window(first, 1, np.random.default_rng(0).normal(size=(length, 2, 2)))
    whole = WindowedColumns(((window,),), (2000,), (2, 4))[0]
    found = filtered_windows(filters, [window], 2000, 4)
    np.testing.assert_allclose(found, filtered(filters, whole), atol=1e-12)
    assert not found[:, :, [0, 3]].any()


@pytest.mark.parametrize("samples", [40, 2000, AT_ONCE, 2 * AT_ONCE + 333])
def test_parts_of_a_run_are_filtered_to_the_bit_like_the_whole(samples: int) -> None:
    filters = decimating_filters(RATE, np.array([20.0, 8.0]), thinning=3)
    whole = np.random.default_rng(0).normal(size=(samples, 2, 3))
    found = filtered_in_parts(filters, lambda part: whole[part], samples, 3)
    np.testing.assert_array_equal(found, filtered(filters, whole))


def test_a_recorded_run_of_eighteen_bits_keeps_its_band(robot: Robot) -> None:
    runs = [motion(run) for run in simulated_runs(robot, [], 1).values()]
    np.testing.assert_array_equal(joint_bands(robot.chain, robot.parameters, runs, 20.0).cutoff, 20.0)
