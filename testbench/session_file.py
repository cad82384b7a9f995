"""A Rerun recording on disk: whole, or not there."""

import errno
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import rerun as rr

from .files import replacing

# What a recording ends with once all of it is written, and in how many last bytes.
FOOTER, LAST = b"RRF2FOOT", 64


@contextmanager
def session_file(
    path: str | Path, application: str, robot: str, blueprint: Any
) -> Iterator[rr.RecordingStream]:
    """A stream that is written to ``path``. Raises InputError where the disk does not take all of it."""
    with replacing(path) as temporary:
        # The robot's name as id: the same input gives the same recording id.
        stream = rr.RecordingStream(application, recording_id=robot, send_properties=False)
        stream.save(temporary, default_blueprint=blueprint)
        yield stream
        stream.disconnect()
        with temporary.open("rb") as written:
            written.seek(-min(LAST, written.seek(0, os.SEEK_END)), os.SEEK_END)
            # Rerun goes on where the disk is full.
            if FOOTER not in written.read():
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
