"""Readers of recordings: one format a file, found by import.

A reader's file has ``FORMAT`` and two functions: ``recognises`` (whether a file is of the format) and
``read`` (its runs as tables). A format's own library is imported when a file of it is read.
"""

import importlib
import pkgutil
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Protocol, cast

import numpy as np

from identification.errors import InputError
from testbench.containment.child import contained
from testbench.files import require_file
from testbench.log import LARGEST, is_measurable

from ..table import Table

# Bytes that a reader is shown of a file to recognise it by.
HEAD = 4096
# Text and messages are read so many times more slowly than a slow disk gives them.
SLOWER = 10
PICKLES = (".pkl", ".pickle", ".joblib", ".pt", ".pth")


@dataclass(frozen=True)
class Format:
    """A format of recordings. suffixes: of its files' names. order: readers that take less ask first."""

    name: str
    description: str
    suffixes: tuple[str, ...]
    order: int = 1


class Reader(Protocol):
    """Interface of a reader's file."""

    FORMAT: Format

    def recognises(self, path: Path, head: bytes) -> bool:
        """Whether a file, or folder, is of this format. head: its first bytes, none of a folder."""
        ...

    def read(self, path: Path) -> list[Table]:
        """The runs in a file, read in this process. Raises InputError, and whatever damage has it raise."""
        ...


@cache
def readers() -> Mapping[str, Reader]:
    """Every reader by name, in the order in which they are asked."""
    names = sorted(module.name for module in pkgutil.iter_modules(__path__))
    modules = [importlib.import_module(f".{name}", __name__) for name in names]
    found = [cast(Reader, module) for module in modules if hasattr(module, "FORMAT")]
    return {each.FORMAT.name: each for each in sorted(found, key=lambda each: each.FORMAT.order)}


def tables(path: Path) -> list[Table]:
    """The runs in a file, read in another process. Raises InputError for all that damage can do there."""
    files = [each for each in path.iterdir() if each.is_file()] if path.is_dir() else [path]
    size = SLOWER * sum(each.stat().st_size for each in files)
    found = contained("recordings.readers:_read", path, "log", _undamaged(reader_of(path)), size=size)
    assert isinstance(found, list)
    for column in (column for table in found for column in table.columns()):
        values = column.values
        if values.dtype.kind == "f" and np.any(np.isfinite(values) & ~is_measurable(values)):
            largest = float(np.abs(values[np.isfinite(values)]).max())
            raise InputError(path, column.name, f"numbers up to {LARGEST:g}", f"{largest:g}")
    return found


def _read(name: str) -> list[Table]:
    """The runs in a file, read in this process."""
    path = Path(name)
    reader = reader_of(path)
    try:
        return reader.read(path)
    except (InputError, MemoryError):
        raise
    # Nothing is known of what a format's library raises of a damaged file.
    except Exception as error:
        got = f"{type(error).__name__}: {error}"
        raise InputError(path, "log", _undamaged(reader), got) from None


def _undamaged(reader: Reader) -> str:
    return f"a file that is not damaged: {reader.FORMAT.description}"


def reader_of(path: Path) -> Reader:
    """The reader of a file, or of a bag's folder. Raises InputError where none knows it."""
    head = b""
    if not path.is_dir():
        require_file(path, "log", "an existing recording")
        with path.open("rb") as file:
            head = file.read(HEAD)
    for each in readers().values():
        if each.recognises(path, head):
            return each
    if path.suffix.lower() in PICKLES:
        expected = "a format that cannot run code: save it as npz, CSV or Parquet"
        raise InputError(path, "log", expected, "a pickle, which is never opened")
    got = (
        "a folder without a bag"
        if path.is_dir()
        else f"a file that none of them is ({path.suffix or 'no suffix'})"
    )
    raise InputError(
        path, "log", "a recording", got, [each.FORMAT.description for each in readers().values()]
    )
