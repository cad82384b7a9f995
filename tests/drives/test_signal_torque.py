"""Torque of a logged current, duty or voltage: by the motor's law, and what is said of its scale."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from studies.drives.leg import recorded, written
from testbench.drive import Drive
from testbench.drives.signal_torque import torque_of_signal
from testbench.log import Recording

CONSTANT, BACK_EMF = np.array([2.0, 3.0]), np.array([0.5, 0.2])


@pytest.fixture
def log(tmp_path: Path) -> Recording:
    """A leg's run; its duty is the share of a torque that is known, and of what its speed takes."""
    run = recorded(written(tmp_path), rate=50.0, duration=3.0)
    torque = np.sin(run.time)[:, None] * np.ones(2)
    speed = np.gradient(run.position, run.time, axis=0)
    duty = (torque + BACK_EMF * speed) / CONSTANT
    drive = Drive("duty", torque_per_unit=CONSTANT, back_emf=BACK_EMF, spread=np.full(2, 0.2))
    return replace(run, controller=None, duty=duty, drive=drive)


def test_a_duty_is_torque_less_the_back_emf(log: Recording) -> None:
    found = torque_of_signal(log, Path("log.h5"))
    assert found is not None
    torque, line = found
    np.testing.assert_allclose(torque, np.sin(log.time)[:, None] * np.ones(2), atol=1e-9)
    assert "less back_emf times the speed" in line
    assert "known to 20%" in line


def test_a_back_emf_that_is_not_stated_counts_as_friction(log: Recording) -> None:
    found = torque_of_signal(replace(log, drive=Drive("duty", torque_per_unit=CONSTANT)), Path("log.h5"))
    assert found is not None
    assert log.duty is not None
    np.testing.assert_array_equal(found[0], log.duty * CONSTANT)
    assert "viscous friction" in found[1]


@pytest.mark.parametrize(
    "lacking",
    [
        {"unsigned": ("duty",)},
        {"drive": None},
        {"drive": Drive("duty", torque_per_unit=np.array([2.0, np.nan]))},
        {"duty": None},
    ],
)
def test_no_sign_or_no_constant_is_no_torque(log: Recording, lacking: dict[str, object]) -> None:
    assert torque_of_signal(replace(log, **lacking), Path("log.h5")) is None
