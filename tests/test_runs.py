"""Logs given to one job: each run once, and torque in every one."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from identification.errors import InputError
from testbench.log import Recording, write_log
from testbench.robot import Robot, load_robot
from testbench.runs import read_runs

from .one_line import complaint
from .synthetic import synthetic_result, synthetic_robot


@pytest.fixture(scope="module")
def robot(tmp_path_factory: pytest.TempPathFactory) -> Robot:
    return synthetic_robot(tmp_path_factory.mktemp("model"))


@pytest.fixture(scope="module")
def recordings(robot: Robot) -> tuple[Recording, Recording]:
    result = synthetic_result(robot)
    return result.fit_recordings[0], result.validation_recordings[0]


@pytest.fixture
def place(
    robot: Robot, recordings: Sequence[Recording], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Path:
    """A folder to stand in: a model, two logs, a copy of the first, and one without torque."""
    (tmp_path / "arm.xml").symlink_to(robot.path)
    silent = replace(recordings[0], torque=np.zeros_like(recordings[0].torque))
    for name, recording in zip(
        ("one", "other", "copy", "silent"), (*recordings, recordings[0], silent), strict=True
    ):
        write_log(recording, tmp_path / f"{name}.h5")
    monkeypatch.chdir(tmp_path)
    return tmp_path


TWICE = [
    ("diagnose --model arm.xml one.h5 one.h5 --out d", "one.h5"),
    ("diagnose --model arm.xml one.h5 other.h5 copy.h5 --out d", "copy.h5"),
    ("identify --model arm.xml one.h5 copy.h5 --out d", "copy.h5"),
    ("identify --model arm.xml one.h5 --validate one.h5 --out d", "one.h5"),
]


@pytest.mark.parametrize(("arguments", "again"), TWICE, ids=[arguments for arguments, _ in TWICE])
def test_a_run_given_twice_is_refused(
    place: Path, arguments: str, again: str, capfd: pytest.CaptureFixture[str]
) -> None:
    line = complaint(arguments, capfd)
    assert line == f"{again}: log: expected each run once, got the run of one.h5 again\n"


@pytest.mark.parametrize("command", ["diagnose", "identify"])
def test_a_log_without_any_torque_is_refused(
    place: Path, command: str, capfd: pytest.CaptureFixture[str]
) -> None:
    line = complaint(f"{command} --model arm.xml other.h5 silent.h5 --out d", capfd)
    assert "silent.h5: joint/torque: expected joint torques that are not all zero, got 0" in line
    assert "turn, lift, reach" in line


def test_a_joint_without_torque_among_others_is_read(
    robot: Robot, recordings: Sequence[Recording], tmp_path: Path
) -> None:
    partly = replace(recordings[0], torque=recordings[0].torque * [1.0, 0.0, 1.0])
    write_log(partly, tmp_path / "partly.h5")
    (found,) = read_runs([tmp_path / "partly.h5"], robot)
    assert np.array_equal(found.torque, partly.torque)


def test_runs_of_other_joints_are_refused(
    robot: Robot, recordings: Sequence[Recording], tmp_path: Path
) -> None:
    write_log(replace(recordings[0], joint_names=("waist", "knee", "ram")), tmp_path / "one.h5")
    with pytest.raises(InputError, match=r"one\.h5: joint_names"):
        read_runs([tmp_path / "one.h5"], robot)


@pytest.mark.parametrize("real", ["tx40", "ur10"])
def test_recordings_of_real_robots_are_taken(real_data, real):
    paths = [real_data / real / name for name in ("half_1.h5", "half_2.h5")]
    assert len(read_runs(paths, load_robot(real_data / real / "nominal.xml"))) == 2
