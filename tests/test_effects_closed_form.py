"""Effects in the simulated robot whose laws are closed forms, along the motion that came about."""

import numpy as np
import pytest

from testbench.log import Recording
from testbench.robot import Robot

from .simulated_arm import robot_from
from .simulated_effects import ARM, placed, run


@pytest.fixture(scope="module")
def arm(tmp_path_factory: pytest.TempPathFactory) -> Robot:
    return robot_from(ARM, tmp_path_factory.mktemp("arm"))


def along(recording: Recording, joint: int) -> tuple[np.ndarray, np.ndarray]:
    """Position and velocity of a joint where it moves, and which samples those are."""
    v = recording.truth["velocity"][:, joint]
    # Within a step of a reversal the set-valued friction takes any value up to its level.
    return np.abs(v) > 0.02, v


@pytest.mark.parametrize("law", ["exponential", "rational"])
def test_stribeck_friction_follows_its_curve(arm: Robot, law: str) -> None:
    recording = run(arm, placed(arm, "stribeck_friction", law, extra=1.2, velocity=0.2, exponent=1.5))
    moving, v = along(recording, 1)
    ratio = (np.abs(v) / 0.2) ** 1.5
    curve = np.exp(-ratio) if law == "exponential" else 1 / (1 + ratio)
    wanted = 3 * v + (2 + 1.2 * curve) * np.sign(v)
    np.testing.assert_allclose(recording.truth["friction_torque"][moving, 1], wanted[moving], atol=6e-3)


def test_asymmetric_friction_does_not_change_sign(arm: Robot) -> None:
    recording = run(arm, placed(arm, "asymmetric_friction", offset=-0.4, viscous_difference=0.5))
    moving, v = along(recording, 1)
    wanted = 3 * v + 2 * np.sign(v) - 0.4 + 0.5 * np.abs(v)
    np.testing.assert_allclose(recording.truth["friction_torque"][moving, 1], wanted[moving], atol=6e-3)


@pytest.mark.parametrize("law", ["power", "saturating"])
def test_nonlinear_viscous_friction_follows_its_power(arm: Robot, law: str) -> None:
    recording = run(arm, placed(arm, "nonlinear_viscous_friction", law, coefficient=1.5, exponent=0.5))
    moving, v = along(recording, 1)
    power = np.sqrt(np.abs(v))
    wanted = 3 * v + (2 + 1.5 * (np.log1p(power) if law == "saturating" else power)) * np.sign(v)
    np.testing.assert_allclose(recording.truth["friction_torque"][moving, 1], wanted[moving], atol=6e-3)


@pytest.mark.parametrize("law", ["symmetric", "driving"])
def test_load_friction_follows_the_torque_that_the_gearbox_carries(arm: Robot, law: str) -> None:
    recording = run(arm, placed(arm, "load_dependent_friction", law, coefficient=0.1))
    moving, v = along(recording, 1)
    truth = recording.truth
    load = truth["torque"][:, 1] - truth["friction_torque"][:, 1] - 0.2 * truth["acceleration"][:, 1]
    share = np.where((law == "driving") & (load * v < 0), 0.05, 0.1)
    wanted = 3 * v + (2 + share * np.abs(load)) * np.sign(v)
    # A held torque that jumps by some 0.1 N·m each period, seen before the jump.
    np.testing.assert_allclose(truth["friction_torque"][moving, 1], wanted[moving], atol=0.05)


@pytest.mark.parametrize("law", ["harmonic", "two_waves"])
def test_ripple_is_periodic_in_the_position(arm: Robot, law: str) -> None:
    second = {"second_amplitude": 0.4, "second_cycles": 34, "second_phase": 1.1}
    recording = run(
        arm, placed(arm, "transmission_ripple", law, amplitude=1.5, cycles=20, phase=0.3, **second)
    )
    q = recording.truth["position"][:, 1]
    wanted = -1.5 * np.sin(20 * q + 0.3)
    if law == "two_waves":
        wanted -= 0.4 * np.sin(34 * q + 1.1)
    np.testing.assert_allclose(recording.truth["effect_torque"][:, 1], wanted, atol=0.02)


def test_springs_pull_towards_their_rest(arm: Robot) -> None:
    balance = placed(arm, "gravity_spring", stiffness=8, phase=0.4)
    cable = placed(arm, "cable_spring", stiffness=2, rest=-0.3)
    recording = run(arm, balance, cable)
    q = recording.truth["link_position"][:, 1]
    wanted = 8 * np.sin(0.4 - q) - 2 * (q + 0.3)
    np.testing.assert_allclose(recording.truth["effect_torque"][:, 1], wanted, atol=2e-3)


def test_a_hardening_cable_doubles_its_stiffness(arm: Robot) -> None:
    recording = run(arm, placed(arm, "cable_spring", "hardening", stiffness=2, rest=-0.3, doubling=0.5))
    pulled = recording.truth["link_position"][:, 1] + 0.3
    wanted = -2 * pulled * (1 + (pulled / 0.5) ** 2)
    # Of half a physics step later.
    atol = 0.11 * float(np.abs(np.diff(wanted)).max())
    np.testing.assert_allclose(recording.truth["effect_torque"][:, 1], wanted, atol=atol)


@pytest.mark.parametrize("law", ["coulomb", "smooth"])
def test_coupling_loads_both_joints_with_their_summed_speed(arm: Robot, law: str) -> None:
    recording = run(arm, placed(arm, "joint_coupling", law, viscous=0.7, coulomb=1.1))
    speed = recording.truth["velocity"][:, 1] + recording.truth["velocity"][:, 2]
    # The shared bristle has slid through once the sum has gone 5 of its 0.5 mrad one way.
    moving = np.abs(speed) > 0.1
    wanted = -0.7 * speed - 1.1 * np.sign(speed)
    settled = moving & np.roll(moving, 50) & (np.sign(speed) == np.sign(np.roll(speed, 50)))
    torque = recording.truth["effect_torque"]
    np.testing.assert_allclose(torque[settled, 1], wanted[settled], atol=6e-3)
    np.testing.assert_array_equal(torque[:, 1], torque[:, 2])


def test_smooth_coupling_is_as_wide_as_it_says(arm: Robot) -> None:
    recording = run(arm, placed(arm, "joint_coupling", "smooth", viscous=0.7, coulomb=1.1, width=0.2))
    speed = recording.truth["velocity"][:, 1] + recording.truth["velocity"][:, 2]
    wanted = -0.7 * speed - 1.1 * np.tanh(speed / 0.2)
    # Of half a physics step later, 0.1 ms of the sample's 1 ms.
    atol = 0.11 * float(np.abs(np.diff(wanted)).max())
    np.testing.assert_allclose(recording.truth["effect_torque"][:, 1], wanted, atol=atol)
