"""Bags of ROS 2 (sqlite3 with or without metadata.yaml, MCAP) and of ROS 1, message by message.

Only topics of joint states and of joint controllers' states are read, so that memory holds joints' numbers
alone, whatever else is in the bag.
"""

import errno
from array import array
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from identification.errors import InputError

from ..table import Channel, Numbers, Stream, Table, distinct
from . import Format
from .ros_messages import MESSAGES, Fields, typestores

FORMAT = Format(
    "ros bag", "ROS bag (.db3, .mcap, .bag, or the folder of one)", (".db3", ".mcap", ".bag"), order=0
)
MAGICS = (b"SQLite format 3\0", b"\x89MCAP0\r\n", b"#ROSBAG V2.0")
METADATA = "metadata.yaml"
# Names of the two clocks of a message.
STAMP, RECEIVED = "header stamp", "receive time"


def recognises(path: Path, head: bytes) -> bool:
    """Whether a file is a bag, or a folder holds one."""
    if path.is_dir():
        return (path / METADATA).is_file() or len(_bags(path)) == 1
    return head.startswith(MAGICS)


def _bags(folder: Path) -> list[Path]:
    return sorted(each for each in folder.iterdir() if each.suffix in FORMAT.suffixes)


def read(path: Path) -> list[Table]:
    """The one run of a bag. Raises InputError."""
    from rosbags.highlevel import AnyReader, AnyReaderError

    place = path
    if path.is_dir() and not (path / METADATA).is_file():
        place = _bags(path)[0]
    recorded: dict[tuple[str, tuple[str, ...]], _Messages] = {}
    try:
        with AnyReader([place], default_typestore=typestores()[0]) as bag:
            wanted = [each for each in bag.connections if each.msgtype in MESSAGES]
            others = [each for each in bag.connections if each.msgtype not in MESSAGES]
            if not wanted:
                got = ", ".join(sorted({f"{each.topic} ({each.msgtype})" for each in others})) or "no topic"
                expected = f"a topic of {', '.join(MESSAGES)}"
                raise InputError(path, "log", expected, got)
            for connection, received, raw in bag.messages(wanted):
                fields = _decoded(bag, connection.msgtype, raw)
                key = (connection.topic, tuple(sorted(fields.joints)))
                recorded.setdefault(key, _Messages(fields)).add(received, fields)
    except OSError as error:
        if error.errno != errno.EFBIG:
            raise
        # It would be unpacked to a file beside, as large as its writer likes.
        expected = "a bag whose messages are compressed, or none of it: unpack it first (zstd -d)"
        raise InputError(path, "log", expected, "files that are compressed as a whole") from None
    # Damage shows as what the decoders of three storages and two encodings happen to raise.
    except (AnyReaderError, ValueError, KeyError, IndexError, AssertionError) as error:
        raise InputError(path, "log", "a bag that can be read", str(error) or type(error).__name__) from None
    return [_table(path, recorded, others)]


def _table(
    path: Path, recorded: Mapping[tuple[str, tuple[str, ...]], "_Messages"], others: Iterable[Any]
) -> Table:
    names = distinct([topic for topic, _ in recorded])
    streams = [each.stream(name) for name, each in zip(names, recorded.values(), strict=True)]
    left_out = sorted({f"{each.topic}: {each.msgtype}" for each in others})
    if not any(stream.samples > 1 for stream in streams):
        raise InputError(path, "log", "messages of joints", "fewer than two")
    kept = tuple(stream for stream in streams if stream.samples > 1)
    return Table(path, FORMAT.name, kept, left_out=tuple(left_out))


def _decoded(bag: Any, type_: str, raw: bytes) -> Fields:
    """A message's fields, by the bag's own definition of its type or one that fits its length."""
    from rosbags.highlevel import AnyReaderError
    from rosbags.serde import SerdeError

    try:
        return MESSAGES[type_](bag.deserialize(raw, type_))
    except (AnyReaderError, KeyError):
        if not bag.is2 or bag.connections[0].msgdef.data:
            raise
    for store in typestores()[1:]:
        try:
            return MESSAGES[type_](store.deserialize_cdr(raw, type_))
        except SerdeError:
            continue
    raise InputError("bag", type_, "a message of a known release", "another layout")


class _Messages:
    """Messages of one topic about the same joints, in the order in which the first one has them."""

    def __init__(self, fields: Fields):
        self.joints = fields.joints
        self._stamps, self._received = array("q"), array("q")
        self._values: dict[str, array[float]] = {}

    def add(self, received: int, fields: Fields) -> None:
        """Take one message; a field that it lacks is NaN."""
        same = fields.joints == self.joints
        order = () if same else [fields.joints.index(joint) for joint in self.joints]
        count, before = len(self.joints), len(self._stamps)
        empty = [np.nan] * count
        for name, values in fields.values.items():
            if name not in self._values:
                self._values[name] = array("d", empty * before)
            row = list(values) if len(values) == count else empty
            self._values[name].extend(row if same else [row[at] for at in order])
        for name in self._values.keys() - fields.values.keys():
            self._values[name].extend(empty)
        self._stamps.append(fields.stamp)
        self._received.append(received)

    def stream(self, topic: str) -> Stream:
        """The messages as a stream; fields that no message has are left out."""
        channels = [
            Channel(STAMP, _column(self._stamps), (), "ns", "time"),
            Channel(RECEIVED, _column(self._received), (), "ns", "time"),
        ]
        for name, values in self._values.items():
            table = np.frombuffer(values).reshape(-1, len(self.joints))
            if not np.isnan(table).all():
                channels.append(Channel(name, table, self.joints))
        return Stream(topic, tuple(channels))


def _column(values: "array[int]") -> Numbers:
    return np.frombuffer(values, dtype=np.int64)[:, np.newaxis]
