"""Folders with a text file for each signal."""

from pathlib import Path

import numpy as np
import pytest

from identification.errors import InputError

from .runs import JOINTS, Run, assert_read, opened, run

NAMES = {"position": "q", "velocity": "dq", "torque": "tau"}


@pytest.fixture(scope="module")
def motion() -> Run:
    return run()


def _write(folder: Path, motion: Run, clock: str, header: bool, files: dict[str, str] = NAMES) -> Path:
    """clock: the name of the column of time stamps in each file; "" for none."""
    folder.mkdir()
    for signal, name in files.items():
        columns = [motion.time, *getattr(motion, signal).T] if clock else [*getattr(motion, signal).T]
        names = ([clock] if clock else []) + list(JOINTS)
        head = ",".join(names) if header else ""
        np.savetxt(folder / f"{name}.csv", np.column_stack(columns), "%.17g", ",", header=head, comments="")
    (folder / "notes.txt").write_text("first try")
    return folder


@pytest.mark.parametrize("header", [True, False])
def test_a_folder_of_signals_is_one_run(tmp_path: Path, motion: Run, header: bool) -> None:
    read = opened(_write(tmp_path / "run", motion, "t", header)).recording
    assert_read(read, motion, ("velocity", "torque"))


def test_time_stamps_may_have_a_file_of_their_own(tmp_path: Path, motion: Run) -> None:
    folder = _write(tmp_path / "run", motion, "", header=False)
    np.savetxt(folder / "time.txt", motion.time)
    assert_read(opened(folder).recording, motion, ("velocity", "torque"))


def test_files_that_name_the_robot_too(tmp_path: Path, motion: Run) -> None:
    files = {"position": "tiago_position", "torque": "tiago_effort"}
    assert_read(opened(_write(tmp_path / "run", motion, "t", True, files)).recording, motion, ("torque",))


def test_signals_of_other_rates_have_stamps_of_their_own(tmp_path: Path, motion: Run) -> None:
    folder = _write(tmp_path / "run", motion, "t", header=True)
    text = (folder / "tau.csv").read_text().splitlines(keepends=True)
    (folder / "tau.csv").write_text("".join([text[0], *text[1::2]]))
    read = opened(folder).recording
    assert read.has_torque
    np.testing.assert_allclose(read.torque[::2][:100], motion.torque[::2][:100], atol=1e-9)


def test_other_lengths_without_stamps_are_refused(tmp_path: Path, motion: Run) -> None:
    folder = _write(tmp_path / "run", motion, "", header=False)
    text = (folder / "tau.csv").read_text().splitlines(keepends=True)
    (folder / "tau.csv").write_text("".join(text[:-5]))
    with pytest.raises(InputError, match=r"as many lines in each file.*295 in tau.csv"):
        opened(folder)


def test_a_folder_of_runs_is_no_run(tmp_path: Path, motion: Run) -> None:
    files = {"position": "run_1", "torque": "run_2"}
    with pytest.raises(InputError, match="a folder without a bag"):
        opened(_write(tmp_path / "runs", motion, "t", True, files))
