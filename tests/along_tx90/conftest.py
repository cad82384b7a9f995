"""The TX-90 along a fast motion, exactly and as simulated with what a test file injects."""

import pytest

from identification.excitation.fourier import FourierSeries
from testbench.effects.logged import Logged
from testbench.log import Recording
from testbench.robot import Robot, load_robot

from .moving_tx90 import exact_run, fast_motion, recorded


@pytest.fixture(scope="package")
def arm(models) -> Robot:
    return load_robot(models / "tx90.xml")


@pytest.fixture(scope="package")
def motion() -> FourierSeries:
    return fast_motion()


@pytest.fixture(scope="package")
def exact(arm, motion) -> Logged:
    return exact_run(arm, motion)


@pytest.fixture(scope="module")
def recordings(arm, motion, request) -> dict[str, Recording]:
    """A run with each of the file's INJECTED effects."""
    return recorded(arm, motion, request.module.INJECTED)
