"""Recordings in formats of others are read where they can neither fill the memory nor crash the program."""

import io
import zipfile
from pathlib import Path

import numpy as np
import pytest

from identification.errors import InputError
from recordings.readers import tables


def test_an_array_larger_than_any_memory_is_one_line(tmp_path: Path) -> None:
    header = io.BytesIO()
    np.lib.format.write_array_header_1_0(
        header, {"descr": "<f8", "fortran_order": False, "shape": (1 << 40,)}
    )
    with zipfile.ZipFile(tmp_path / "run.npz", "w") as archive:
        archive.writestr("time.npy", header.getvalue())
    with pytest.raises(InputError, match=r"run\.npz: log: expected .*, got a file that takes over 4 GiB"):
        tables(tmp_path / "run.npz")


def test_text_that_is_none_further_down_is_one_line(tmp_path: Path) -> None:
    lines = "time,q\n" + "".join(f"{index},{index}\n" for index in range(20_000))
    (tmp_path / "run.csv").write_bytes(lines.encode() + b"\xff\xfe,1\n1,2\n")
    with pytest.raises(InputError, match=r"run\.csv: log: expected .*, got UnicodeDecodeError"):
        tables(tmp_path / "run.csv")


def test_what_nothing_is_measured_as_is_one_line(tmp_path: Path) -> None:
    lines = "time,q,tau\n" + "".join(f"{index},{index},1e300\n" for index in range(20))
    (tmp_path / "run.csv").write_text(lines)
    with pytest.raises(InputError, match=r"run\.csv: tau: expected numbers up to 1e\+100, got 1e\+300"):
        tables(tmp_path / "run.csv")
