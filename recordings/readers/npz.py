"""Arrays that numpy saved: .npz. Arrays of objects are pickles and stay closed."""

import zipfile
from pathlib import Path

import numpy as np

from identification.errors import InputError

from ..table import Channel, Stream, Table, as_columns
from . import Format

FORMAT = Format("npz", "numpy (.npz)", (".npz",))


def recognises(path: Path, head: bytes) -> bool:
    """Whether a file is a zip archive named .npz."""
    return path.suffix.lower() == ".npz" and head.startswith(b"PK")


def read(path: Path) -> list[Table]:
    """The one run of an archive: its arrays of the commonest length. Raises InputError."""
    arrays, names, left_out = {}, {}, []
    try:
        with np.load(path, allow_pickle=False) as archive:
            for key in archive.files:
                try:
                    values = archive[key]
                except ValueError as error:
                    # numpy says so of what only a pickle could hold.
                    reason = (
                        "an object, which is a pickle and never opened" if "pickle" in str(error) else error
                    )
                    left_out.append(f"{key}: {reason}")
                    continue
                if values.dtype.kind in "US" and values.ndim == 1:
                    names[key] = tuple(str(name) for name in values.tolist())
                elif values.dtype.kind in "fiub" and values.ndim in (1, 2) and len(values) > 1:
                    arrays[key] = values
                else:
                    left_out.append(f"{key}: {values.dtype} of shape {values.shape}, no samples")
    except (OSError, zipfile.BadZipFile, EOFError) as error:
        raise InputError(path, "log", "an archive that numpy saved", str(error) or "a damaged file") from None
    lengths = [len(values) for values in arrays.values()]
    if not lengths:
        got = "; ".join(left_out) or "none"
        raise InputError(path, "log", "arrays of one or two dimensions", got)
    samples = max(lengths, key=lambda length: (lengths.count(length), length))
    channels = []
    for key, values in arrays.items():
        if len(values) != samples:
            left_out.append(f"{key}: {len(values)} values where there are {samples} samples")
            continue
        columns = as_columns(values)
        channels.append(Channel(key, columns, _labels(names, columns.shape[1])))
    return [Table(path, FORMAT.name, (Stream("", tuple(channels)),), left_out=tuple(left_out))]


def _labels(names: dict[str, tuple[str, ...]], count: int) -> tuple[str, ...]:
    """The one list of names that has so many, or none."""
    fitting = [each for each in names.values() if len(each) == count > 1]
    return fitting[0] if len(fitting) == 1 else ()
