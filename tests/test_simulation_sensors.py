"""Encoders and torque sensors of the simulated robot: grids, noise, delay."""

import numpy as np
import pytest

from testbench.robot import Robot
from testbench.simulation import SensorOptions, SimulationOptions, simulate
from testbench.simulation.sensors import centred_torque, encoder_quantum, measured_torque, white_noise

from .simulated_arm import ARM, ARM_MOTION, RATE, robot_from


@pytest.fixture(scope="module")
def arm(tmp_path_factory: pytest.TempPathFactory) -> Robot:
    return robot_from(ARM, tmp_path_factory.mktemp("arm"))


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
