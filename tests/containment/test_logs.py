"""Logs of strangers: what is not in the file is not read, and damage is one line."""

import os
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest

from identification.errors import InputError
from testbench.containment import child
from testbench.log import Recording, read_log, write_log

SAMPLES = 200
Change = Callable[[h5py.File], None]


def recording() -> Recording:
    motion = np.sin(np.linspace(0.0, 6.0, SAMPLES))[:, np.newaxis] * [1.0, 2.0]
    return Recording("arm", ("a", "b"), 250.0, "hardware", np.arange(SAMPLES) / 250, motion, 3 * motion)


@pytest.fixture
def log(tmp_path: Path) -> Path:
    write_log(recording(), tmp_path / "run.h5")
    return tmp_path / "run.h5"


@pytest.fixture
def secret(tmp_path: Path) -> Path:
    """Another file of the user's, which is a log too."""
    write_log(recording(), tmp_path / "other.h5")
    return tmp_path / "other.h5"


def changed(log: Path, change: Change) -> str:
    """The line that is said of the log once it is changed."""
    with h5py.File(log, "r+") as file:
        change(file)
    with pytest.raises(InputError) as error:
        read_log(log)
    line = str(error.value)
    assert line.startswith(f"{log}: ")
    assert line.isprintable()
    return line


def replaced(name: str, make: Callable[[h5py.File, tuple[int, ...]], h5py.Dataset]) -> Change:
    def change(file: h5py.File) -> None:
        unit, shape = file[name].attrs["unit"], file[name].shape
        del file[name]
        make(file, shape)
        file[name].attrs["unit"] = unit

    return change


def external(name: str, source: Path) -> Change:
    parts = [(str(source), 0, h5py.h5f.UNLIMITED)]
    return replaced(name, lambda file, shape: file.create_dataset(name, shape, "f8", external=parts))


def test_data_in_another_file_is_refused(log: Path, secret: Path) -> None:
    assert "joint/position: expected data stored in this file itself" in changed(
        log, external("joint/position", secret)
    )


def test_data_in_a_pipe_is_refused_at_once(log: Path, tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    assert "time: expected data stored in this file itself" in changed(
        log, external("time", tmp_path / "pipe")
    )


def test_a_link_to_another_file_is_refused(log: Path, secret: Path) -> None:
    def change(file: h5py.File) -> None:
        del file["joint"]
        file["joint"] = h5py.ExternalLink(secret, "/joint")

    assert f"got a link to {secret}" in changed(log, change)


def test_a_link_to_a_link_to_another_file_is_refused(log: Path, secret: Path) -> None:
    def change(file: h5py.File) -> None:
        del file["joint/torque"]
        file["aside"] = h5py.ExternalLink(secret, "/joint")
        file["joint/torque"] = h5py.SoftLink("/aside/torque")

    assert f"joint/torque: expected data stored in this file itself, got a link to {secret}" in changed(
        log, change
    ).replace("aside/torque", "joint/torque")


def test_a_virtual_dataset_is_refused(log: Path, secret: Path) -> None:
    def make(file: h5py.File, shape: tuple[int, ...]) -> h5py.Dataset:
        layout = h5py.VirtualLayout(shape, "f8")
        layout[:] = h5py.VirtualSource(secret, "joint/torque", shape)
        return file.create_virtual_dataset("joint/torque", layout)

    assert "got a virtual dataset" in changed(log, replaced("joint/torque", make))


def test_a_link_within_the_file_is_followed(log: Path) -> None:
    with h5py.File(log, "r+") as file:
        file["aside"] = file["joint/torque"]
        del file["joint/torque"]
        file["joint/torque"] = h5py.SoftLink("../aside")
        del file["joint/torque"]
        file["joint/torque"] = h5py.SoftLink("/aside")
    np.testing.assert_array_equal(read_log(log).torque, recording().torque)


def test_links_in_a_circle_are_refused(log: Path) -> None:
    def change(file: h5py.File) -> None:
        del file["joint"]
        file["joint"], file["round"] = h5py.SoftLink("/round"), h5py.SoftLink("/joint")

    assert "links in a circle" in changed(log, change)


@pytest.mark.parametrize("shape", [(1 << 28, 2), (1 << 40, 1 << 20)])
def test_a_shape_that_no_log_has_is_not_read(log: Path, shape: tuple[int, int]) -> None:
    make = replaced(
        "joint/position",
        lambda file, _: file.create_dataset("joint/position", shape, "f8", chunks=(1024, 2), compression=9),
    )
    assert "joint/position: expected at most 1024 MiB a dataset" in changed(log, make)


def test_text_that_is_not_utf8_is_refused(log: Path) -> None:
    def change(file: h5py.File) -> None:
        del file.attrs["robot"]
        file.attrs.create("robot", b"St\xe4ubli", dtype=h5py.string_dtype("utf-8", 7))

    assert "robot: expected text in UTF-8" in changed(log, change)


def test_stamps_that_no_grid_spans_are_refused(log: Path) -> None:
    def change(file: h5py.File) -> None:
        file["time"][-1] = 1e308

    assert "time: expected 200 samples within 80 s" in changed(log, change)


def test_damage_anywhere_is_one_line(log: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # Some damage has libhdf5 loop until it is ended.
    monkeypatch.setattr(child, "PATIENCE", 2.0)
    whole, random, lines = log.read_bytes(), np.random.default_rng(3), []
    for _ in range(100):
        data = bytearray(whole)
        for place in random.integers(0, len(data) // 4, 4):
            data[place] = random.integers(0, 256)
        log.write_bytes(data)
        try:
            read_log(log)
        except InputError as error:
            lines.append(str(error))
    assert len(lines) > 10
    assert all(line.startswith(f"{log}: ") and line.isprintable() for line in lines)
