"""The robot-log format itself, for logs whose joints are to be chosen, ordered or scaled."""

from pathlib import Path

import numpy as np

from testbench.log import CHANNELS, read_here

from ..table import Channel, Stream, Table
from . import Format

FORMAT = Format("robot-log", "robot-log (.h5)", (".h5", ".hdf5"))
SIGNATURE = b"\x89HDF\r\n\x1a\n"


def recognises(path: Path, head: bytes) -> bool:
    """Whether a file is HDF5."""
    return head.startswith(SIGNATURE)


def read(path: Path) -> list[Table]:
    """The one run of a robot-log. Raises InputError."""
    recording = read_here(str(path))
    slides = recording.is_slide or (False,) * len(recording.joint_names)
    channels = [Channel("time", recording.time[:, np.newaxis], (), "s", "time")]
    for name, field, hinge, slide in CHANNELS:
        values = getattr(recording, field)
        # Where hinges and slides mix, each joint has its own SI unit.
        unit = "SI" if hinge != slide and any(slides) else hinge
        if values is not None and not np.isnan(values).all():
            channels.append(Channel(name, values, recording.joint_names, unit, field))
    return [Table(path, FORMAT.name, (Stream("", tuple(channels)),), robot=recording.robot)]
