"""Torque of a logged current, duty or voltage: by the motor's law, and what is said of its scale."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from identification.errors import InputError
from studies.drives.leg import recorded, written
from testbench.drive import Drive
from testbench.drives.signal_torque import torque_of_signal
from testbench.log import Recording
from testbench.robot import Robot, load_robot

CONSTANT, BACK_EMF = np.array([2.0, 3.0]), np.array([0.5, 0.2])


@pytest.fixture
def robot(tmp_path: Path) -> Robot:
    return load_robot(written(tmp_path))


@pytest.fixture
def log(tmp_path: Path) -> Recording:
    """A leg's run; its duty is the share of a torque that is known, and of what its speed takes."""
    run = recorded(written(tmp_path), rate=50.0, duration=3.0)
    torque = np.sin(run.time)[:, None] * np.ones(2)
    speed = np.gradient(run.position, run.time, axis=0)
    duty = (torque + BACK_EMF * speed) / CONSTANT
    drive = Drive("duty", torque_per_unit=CONSTANT, back_emf=BACK_EMF, spread=np.full(2, 0.2))
    return replace(run, controller=None, duty=duty, drive=drive)


def test_a_duty_is_torque_less_the_back_emf(log: Recording, robot: Robot) -> None:
    found = torque_of_signal(log, Path("log.h5"), robot)
    assert found is not None
    torque, line = found
    np.testing.assert_allclose(torque, np.sin(log.time)[:, None] * np.ones(2), atol=1e-9)
    assert "less back_emf times the speed" in line
    assert "known to 20%" in line


def test_a_back_emf_that_is_not_stated_counts_as_friction(log: Recording, robot: Robot) -> None:
    bare = replace(log, drive=Drive("duty", torque_per_unit=CONSTANT))
    found = torque_of_signal(bare, Path("log.h5"), robot)
    assert found is not None
    assert log.duty is not None
    np.testing.assert_array_equal(found[0], log.duty * CONSTANT)
    assert "viscous friction" in found[1]


@pytest.mark.parametrize(
    "lacking",
    [
        {"drive": None},
        {"drive": Drive("duty", torque_per_unit=np.array([2.0, np.nan]))},
        {"duty": None},
    ],
)
def test_no_constant_is_no_torque(log: Recording, robot: Robot, lacking: dict[str, object]) -> None:
    assert torque_of_signal(replace(log, **lacking), Path("log.h5"), robot) is None


def test_a_size_that_no_law_of_the_robot_has_is_refused(log: Recording, robot: Robot) -> None:
    noise = np.abs(np.random.default_rng(0).standard_normal(log.position.shape))
    with pytest.raises(InputError, match="a clear sign for"):
        torque_of_signal(replace(log, duty=noise, unsigned=("duty",)), Path("log.h5"), robot)
