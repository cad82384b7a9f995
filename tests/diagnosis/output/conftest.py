"""One diagnosed arm for all of these tests."""

from pathlib import Path

import numpy as np
import pytest

from diagnosis.correction.corrected_mjcf import Written
from diagnosis.correction.file_error import FileError
from diagnosis.decision.findings import Diagnosis
from diagnosis.report.document import write_diagnosis
from testbench.effects import injection
from testbench.log import Recording, write_log
from testbench.robot import Robot, load_robot

from ...diagnosed import diagnosed, in_closed_loop, simulated_runs
from .arm import ARM, LIFT

WRITTEN = Written(("something",), FileError(np.full(3, 4.0), np.full(3, 1.0), np.full(3, 2.0)))


@pytest.fixture(scope="package")
def robot(tmp_path_factory: pytest.TempPathFactory) -> Robot:
    path = tmp_path_factory.mktemp("robot") / "arm.xml"
    path.write_text(ARM)
    return load_robot(path)


@pytest.fixture(scope="package")
def runs(robot: Robot) -> dict[str, Recording]:
    """Three runs of an arm with Stribeck friction on its second joint; the last is never diagnosed."""
    law = {"extra": 4.0, "velocity": 0.2, "exponent": 1.0}
    return simulated_runs(robot, [injection(robot, "stribeck_friction", "lift", law)], 3)


@pytest.fixture(scope="package")
def answer(robot: Robot, runs: dict[str, Recording]) -> Diagnosis:
    known = {name: runs[name] for name in ("run_1", "run_2")}
    return diagnosed(robot, known, [("stribeck_friction", LIFT, None)], ("presliding_hysteresis",))


@pytest.fixture(scope="package")
def folder(answer: Diagnosis, runs: dict[str, Recording], tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("diagnosis")
    write_diagnosis(answer, out / "diagnosis.json", WRITTEN, in_closed_loop(answer, runs))
    write_log(runs["run_3"], out / "unseen.h5")
    return out
