"""A run of the small arm as plain arrays, and what reading a file of it must give back."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from recordings.door import Door, Opened
from recordings.joints import Joints, joints_named
from testbench.log import Recording

Array = NDArray[np.float64]

JOINTS = ("shoulder", "elbow")
RATE, SAMPLES = 200.0, 300
LOWER, UPPER, TORQUE = np.array([-2.0, -2.0]), np.array([2.0, 2.0]), np.array([80.0, 30.0])


@dataclass(frozen=True)
class Run:
    """Arrays (N,) and (N, n) in SI units."""

    time: Array
    position: Array
    velocity: Array
    torque: Array
    reference: Array


def run(joints: int = 2) -> Run:
    """A smooth motion within the arm's limits; torque that is no derivative of it."""
    time = np.arange(SAMPLES) / RATE
    phase = 2 * np.pi * time[:, np.newaxis] * np.linspace(1.0, 1.7, joints)
    amplitude = np.linspace(1.2, 0.6, joints)
    position = amplitude * np.sin(phase) + 0.1
    speed = 2 * np.pi * np.linspace(1.0, 1.7, joints)
    velocity = amplitude * speed * np.cos(phase)
    torque = 15 * np.cos(position) + 3 * np.sign(velocity)
    return Run(time, position, velocity, torque, position + 0.02 * np.cos(phase))


def arm_joints() -> Joints:
    """The small arm's joints and limits, as its model has them."""
    return Joints(JOINTS, (False, False), LOWER, UPPER, TORQUE, are_of_model=True)


def opened(path: Path, joints: Joints | None = None, map_path: Path | None = None) -> Opened:
    return Door(joints or arm_joints(), map_path).log(path)


def assert_read(recording: Recording, expected: Run, fields: Sequence[str], tolerance: float = 1e-9) -> None:
    """The recording has these fields of the run, and none of the others."""
    assert recording.joint_names == JOINTS[: expected.position.shape[1]]
    np.testing.assert_allclose(recording.time, expected.time - expected.time[0], atol=1e-8)
    np.testing.assert_allclose(recording.position, expected.position, atol=tolerance)
    assert recording.has_torque == ("torque" in fields)
    if "torque" in fields:
        np.testing.assert_allclose(recording.torque, expected.torque, atol=100 * tolerance)
    for name, value, wanted in (
        ("velocity", recording.velocity, expected.velocity),
        ("reference", recording.reference_position, expected.reference),
    ):
        assert (value is not None) == (name in fields), name
        if value is not None:
            np.testing.assert_allclose(value, wanted, atol=100 * tolerance)


def numbered(count: int) -> Joints:
    """Joints joint_1 and so on, of which nothing but the names is known."""
    return joints_named([f"joint_{index + 1}" for index in range(count)])
