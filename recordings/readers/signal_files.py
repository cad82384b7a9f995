"""A folder with a text file for each signal, such as q.csv, dq.csv and tau.csv: one run."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from identification.errors import InputError

from ..guess.names import is_time, parsed, quantity_of
from ..table import UNNAMED, Channel, Stream, Table
from . import Format, delimited_text

FORMAT = Format(
    "signal_files", "a folder of text files, one a signal (position.csv, effort.csv)", (), order=3
)


def recognises(path: Path, head: bytes) -> bool:
    """Whether a folder has positions and another signal in text files, named after it."""
    return path.is_dir() and "position" in (found := _quantities(path)) and len(found) > 1


def _quantities(folder: Path) -> dict[str, Path]:
    """The file of each quantity that one file alone is named after, and of ``time``."""
    found: dict[str, list[Path]] = {}
    for path in sorted(folder.iterdir()):
        if path.is_file() and path.suffix.lower() in delimited_text.FORMAT.suffixes:
            words = parsed(path.stem).words
            quantity = "time" if is_time(words) else quantity_of(words)[0]
            found.setdefault(quantity, []).append(path)
    return {quantity: paths[0] for quantity, paths in found.items() if quantity and len(paths) == 1}


def read(path: Path) -> list[Table]:
    """The one run of a folder. Raises InputError.

    Files of as many lines were sampled together, where they have the same stamps or none.
    """
    files = _quantities(path)
    tables = {file: delimited_text.read(file)[0] for file in files.values()}
    streams = {file: table.streams[0] for file, table in tables.items()}
    of_time = files.get("time")
    clocks = {
        file: clock
        for file, each in streams.items()
        if (clock := each.channels[0] if file == of_time else _clock(each)) is not None
    }
    left_out = tuple(f"{file.name}: {note}" for file, table in tables.items() for note in table.left_out)
    signals = {
        file: [
            replace(channel, name=f"{file.stem}_{channel.name}")
            for channel in each.channels
            if channel is not clocks.get(file)
        ]
        for file, each in streams.items()
    }
    one, *others = [clock.values for clock in clocks.values()] or [np.zeros(0)]
    if len({each.samples for each in streams.values()}) == 1 and all(
        np.array_equal(one, other) for other in others
    ):
        stamps = [replace(each, name="time") for each in list(clocks.values())[:1]]
        channels = (*stamps, *(channel for each in signals.values() for channel in each))
        return [Table(path, FORMAT.name, (Stream("", channels),), left_out=left_out)]
    if len(clocks) < len(streams):
        lines = ", ".join(f"{each.samples} in {file.name}" for file, each in streams.items())
        raise InputError(path, "log", "as many lines in each file, or time stamps in each", lines)
    apart = tuple(Stream(file.stem, (clocks[file], *signals[file])) for file in streams)
    return [Table(path, FORMAT.name, apart, left_out=left_out)]


def _clock(stream: Stream) -> Channel | None:
    """The time stamps in a file: a column that is named so, or without names a first one that increases."""
    for channel in stream.channels:
        if channel.values.shape[1] == 1 and is_time(parsed(channel.name).words):
            return channel
    first = stream.channels[0]
    named = not first.name.startswith(UNNAMED)
    if named or len(stream.channels) < 2 or not np.all(np.diff(first.values[:, 0]) > 0):
        return None
    return first
