from pathlib import Path

import pytest

from testbench.log import Recording
from testbench.robot import Robot

from .diagnosed import measured_only, simulated_runs
from .small_arm import small_arm

ROOT = Path(__file__).parents[1]


@pytest.fixture(scope="session")
def models():
    return ROOT / "models"


@pytest.fixture(scope="session")
def arm(tmp_path_factory: pytest.TempPathFactory) -> Robot:
    """The small arm, where a test has no other."""
    return small_arm(tmp_path_factory.mktemp("arm"))


@pytest.fixture(scope="session")
def healthy_runs(arm: Robot) -> dict[str, Recording]:
    """Three runs of the small arm without any effect: position and torque alone."""
    return {name: measured_only(run) for name, run in simulated_runs(arm, [], runs=3).items()}


@pytest.fixture(scope="session")
def real_data():
    """Recordings of real robots, where they lie beside the project."""
    folder = ROOT.parent / "shared" / "data"
    if not folder.is_dir():
        pytest.skip("no recordings of real robots beside the project")
    return folder
