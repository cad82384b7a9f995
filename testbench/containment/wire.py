"""Messages between a process and its reader: values with their arrays, and nothing that can run code.

The reader may have been taken over by the file that it read, so what comes from it is never unpickled
freely: only plain values, arrays and the classes listed here.
"""

import importlib
import io
import pickle
import struct
from dataclasses import is_dataclass
from typing import IO, Any

from identification.errors import InputError

# Packages whose dataclasses and errors may come from the reader, and what arrays are made by.
PACKAGES = ("identification", "recordings", "testbench")
FUNCTIONS = {
    ("pathlib", "PosixPath"),
    ("pathlib", "WindowsPath"),
    ("numpy", "dtype"),
    ("numpy", "ndarray"),
    ("numpy._core.numeric", "_frombuffer"),
    ("numpy._core.multiarray", "_reconstruct"),
    ("numpy._core.multiarray", "scalar"),
}
LENGTH = struct.Struct("<Q")
# Bytes of values and of all arrays together that one message may have.
MOST_VALUES, MOST_ARRAYS = 1 << 28, 5 << 29


class BrokenMessageError(Exception):
    """The other side has gone, or says what it should not."""


class _Restricted(pickle.Unpickler):
    def find_class(self, module: str, name: str) -> Any:
        if (module, name) in FUNCTIONS:
            return getattr(importlib.import_module(module), name)
        if module.split(".")[0] in PACKAGES and name.isidentifier():
            found = getattr(importlib.import_module(module), name, None)
            if isinstance(found, type) and (is_dataclass(found) or issubclass(found, InputError)):
                return found
        raise BrokenMessageError(f"{module}.{name} in an answer")


def send(stream: IO[bytes], value: Any) -> None:
    """Write a value; its arrays follow it without being copied."""
    buffers: list[pickle.PickleBuffer] = []
    values = pickle.dumps(value, protocol=5, buffer_callback=buffers.append)
    raw = [buffer.raw() for buffer in buffers]
    stream.write(LENGTH.pack(len(raw)) + LENGTH.pack(len(values)) + values)
    for each in raw:
        stream.write(LENGTH.pack(each.nbytes))
        stream.write(each)
    stream.flush()


def receive(stream: IO[bytes]) -> Any:
    """Read what ``send`` wrote. Raises BrokenMessageError where it ends early or holds anything else."""
    count, size = (LENGTH.unpack(_exactly(stream, LENGTH.size))[0] for _ in range(2))
    if size > MOST_VALUES:
        raise BrokenMessageError("an answer that is too large")
    values, buffers, left = _exactly(stream, size), [], MOST_ARRAYS
    for _ in range(count):
        (length,) = LENGTH.unpack(_exactly(stream, LENGTH.size))
        left -= length
        if left < 0:
            raise BrokenMessageError("an answer that is too large")
        buffers.append(_exactly(stream, length))
    try:
        return _Restricted(io.BytesIO(values), buffers=buffers).load()
    except BrokenMessageError:
        raise
    except Exception as error:
        raise BrokenMessageError(f"an answer that cannot be read: {error}") from None


def _exactly(stream: IO[bytes], size: int) -> bytearray:
    data = bytearray(size)
    view, done = memoryview(data), 0
    while done < size:
        count = stream.readinto(view[done:])  # type: ignore[attr-defined]  # its type leaves it out
        if not count:
            raise BrokenMessageError("the reader has ended")
        done += count
    return data
