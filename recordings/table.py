"""A recording as its file holds it, before any of it is understood."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

# Numbers as the file has them: time stamps in nanoseconds stay whole numbers.
Numbers = NDArray[Any]
# Columns of a file without names are called so, with their place from 1.
UNNAMED = "column "


@dataclass(frozen=True)
class Channel:
    """Values that the file keeps together, such as a column, a list in a cell or an array of a message.

    name: the file's. values: (N, k). labels: k names of the values within the channel, empty where the file
    has none. unit: as the file states it, or empty. quantity: what the format itself says that it is, spelled
    as in ``recordings.mapping.QUANTITIES``, or empty.
    """

    name: str
    values: Numbers
    labels: tuple[str, ...] = ()
    unit: str = ""
    quantity: str = ""

    def columns(self) -> tuple[str, ...]:
        """The k names that a mapping uses: the channel's, and in brackets the label of each of several."""
        if self.labels:
            return tuple(f"{self.name}[{label}]" for label in self.labels)
        if self.values.shape[1] == 1:
            return (self.name,)
        return tuple(f"{self.name}[{index}]" for index in range(self.values.shape[1]))


@dataclass(frozen=True)
class Stream:
    """Channels that were sampled together. name: of the topic, empty in a file that has one stream."""

    name: str
    channels: tuple[Channel, ...]

    @property
    def samples(self) -> int:
        """Number of samples."""
        return len(self.channels[0].values) if self.channels else 0

    def column_name(self, column: str) -> str:
        """A column's name within the whole recording."""
        return f"{self.name}.{column}" if self.name else column


@dataclass(frozen=True)
class Column:
    """One column of a stream. name: within the recording; label: of the value within its channel."""

    name: str
    stream: Stream
    channel: Channel
    label: str
    values: Numbers


@dataclass(frozen=True)
class Table:
    """One run as it was recorded.

    path: the file. format: the reader's name. streams: at least one. robot: a name, where the file has one.
    episode: its number in a file of several runs. facts: single values beside the samples, JSON-able.
    left_out: what the reader did not take, in words.
    """

    path: Path
    format: str
    streams: tuple[Stream, ...]
    robot: str = ""
    episode: int | None = None
    facts: dict[str, Any] = field(default_factory=dict)
    left_out: tuple[str, ...] = ()

    def columns(self) -> Iterator[Column]:
        """Every column, in the file's order."""
        for stream in self.streams:
            for channel in stream.channels:
                for index, name in enumerate(channel.columns()):
                    label = channel.labels[index] if channel.labels else ""
                    values = channel.values[:, index]
                    yield Column(stream.column_name(name), stream, channel, label, values)


def distinct(names: list[str]) -> list[str]:
    """The names, with ``#2``, ``#3`` after those that repeat."""
    seen: dict[str, int] = {}
    found = []
    for name in names:
        seen[name] = seen.get(name, 0) + 1
        found.append(name if seen[name] == 1 else f"{name}#{seen[name]}")
    return found


def as_columns(values: Any) -> Numbers:
    """An array of one or two dimensions as (N, k) numbers; whole numbers stay whole."""
    array = np.asarray(values)
    if array.dtype.kind not in "iu":
        array = array.astype(np.float64)
    return array.reshape(len(array), -1)
