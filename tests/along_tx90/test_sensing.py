"""Effects of the encoders: simulation against their laws, signatures against changed torques."""

import numpy as np
import pytest

from identification.errors import InputError
from identification.excitation.fourier import FourierSeries
from testbench.effects import effect, injection
from testbench.effects.base import Injection
from testbench.robot import Robot, load_robot
from testbench.simulation import SimulationOptions, sample_reference, simulate

from .moving_tx90 import RATE, explained, fitted, torque

INJECTED = {
    "offset": ("encoder_offset", 3, {"offset": 0.02}, None),
    "eccentricity": ("encoder_eccentricity", 4, {"amplitude": 0.01, "phase": 0.7}, None),
}


# In closed loop


def test_the_encoder_reads_the_true_angle_and_its_error(recordings):
    run = recordings["offset"]
    error = run.position - run.truth["position"]
    np.testing.assert_allclose(error, np.broadcast_to([0, 0, 0.02, 0, 0, 0], error.shape), atol=1e-12)
    run = recordings["eccentricity"]
    error, q = run.position - run.truth["position"], run.truth["position"][:, 3]
    np.testing.assert_allclose(error[:, 3], 0.01 * np.sin(q + 0.7), atol=1e-12)
    assert not np.delete(error, 3, axis=1).any()


def test_eccentricity_is_refused_on_a_slide_joint(models):
    rail = load_robot(models / "rail_arm.xml")
    run = simulate_one(rail, injection(rail, "encoder_eccentricity", 1, {"amplitude": 0.01}))
    with pytest.raises(InputError, match="revolutions"):
        run()


def simulate_one(robot: Robot, each: Injection):
    still = np.zeros((3, robot.joints))
    reference = sample_reference(FourierSeries(1.0, still[0], still[:2].T, still[:2].T), RATE)
    return lambda: simulate(robot, [reference], SimulationOptions(effects=(each,)))


# Signatures along exact motions


def test_an_encoder_offset_is_explained(arm, exact):
    change = torque(arm, exact.q - 0.02 * np.eye(6)[2], exact.dq, exact.ddq) - exact.tau
    family = effect("encoder_offset").signature([exact], 2, None)
    assert explained(exact, family, change)[0] > 0.9
    assert fitted(exact, family, change)["offset"].value == pytest.approx(0.02, rel=0.05)


@pytest.mark.parametrize("joint", [1, 3])
def test_an_eccentric_encoder_is_explained(arm, exact, joint):
    amplitude, phase = 0.01, 0.7
    unit = np.eye(6)[joint]
    true = exact.q.copy()
    for _ in range(30):
        true = exact.q - amplitude * np.sin(true + phase) * unit
    angle = true[:, [joint]] + phase
    slope = 1 + amplitude * np.cos(angle)
    speed = exact.dq * (1 - unit) + exact.dq * unit / slope
    curve = amplitude * np.sin(angle) * speed[:, [joint]] ** 2 * unit
    acceleration = exact.ddq * (1 - unit) + (exact.ddq + curve) * unit / slope
    change = torque(arm, true, speed, acceleration) - exact.tau
    family = effect("encoder_eccentricity").signature([exact], joint, None)
    assert explained(exact, family, change)[0] > 0.9
    found = fitted(exact, family, change)
    assert found["amplitude"].value == pytest.approx(amplitude, rel=0.05)
    assert found["phase"].value == pytest.approx(phase, abs=0.05)
