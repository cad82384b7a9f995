"""One array with named columns that numpy saved: .npy."""

from pathlib import Path

import numpy as np

from identification.errors import InputError

from ..table import Channel, Stream, Table, as_columns
from . import Format

FORMAT = Format("npy", "numpy, one array with named columns (.npy)", (".npy",))


def recognises(path: Path, head: bytes) -> bool:
    """Whether a file begins as numpy's do."""
    return head.startswith(b"\x93NUMPY")


def read(path: Path) -> list[Table]:
    """The one run of a file. Raises InputError."""
    array = np.load(path, allow_pickle=False)
    if array.dtype.names is None:
        raise InputError(path, "log", "an array with named columns", f"one of {array.dtype}")
    channels = tuple(Channel(name, as_columns(array[name])) for name in array.dtype.names)
    return [Table(path, FORMAT.name, (Stream("", channels),))]
