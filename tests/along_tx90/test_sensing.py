"""Effects of the encoders: simulation against their laws, signatures against changed torques."""

import numpy as np
import pytest

from identification.errors import InputError
from testbench.effects import effect, injection
from testbench.effects.signature import places
from testbench.robot import load_robot

from .moving_tx90 import explained, fitted, torque

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


@pytest.mark.parametrize("name", ["encoder_eccentricity", "gravity_spring"])
def test_laws_of_an_angle_are_refused_on_a_slide_joint_and_not_sought_there(models, name):
    rail = load_robot(models / "rail_arm.xml")
    with pytest.raises(InputError, match="a hinge, got the slide"):
        injection(rail, name, 1)
    assert 0 not in [joint for joint, _ in places(effect(name).DESCRIPTION, rail.chain.is_slide)]


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
