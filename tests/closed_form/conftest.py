"""The arm along a motion in closed form."""

import numpy as np
import pytest

from testbench.effects.signature import Logged
from testbench.robot import Robot

from ..closed_form_arm import base_space, closed_form_run
from ..simulated_arm import robot_from
from ..simulated_effects import ARM


@pytest.fixture(scope="package")
def arm(tmp_path_factory: pytest.TempPathFactory) -> Robot:
    return robot_from(ARM, tmp_path_factory.mktemp("arm"))


@pytest.fixture(scope="package")
def logged(arm: Robot) -> Logged:
    return closed_form_run(arm)


@pytest.fixture(scope="package")
def base(arm: Robot) -> np.ndarray:
    return base_space(arm)
