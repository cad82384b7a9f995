"""Files that are either complete or not there."""

import json
import os
import stat
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from identification.errors import InputError

from .containment.json_text import read_bounded_json


@contextmanager
def replacing(path: str | Path) -> Iterator[Path]:
    """A temporary path beside ``path`` that takes its place when the block ends without an error.

    Raises InputError where the system will not have it written, as on a full disk.
    """
    path = Path(path)
    _require_replaceable(path)
    temporary: Path | None = None
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(prefix=f".{path.stem}.", suffix=path.suffix, dir=path.parent)
        os.close(handle)
        temporary = Path(name)
        yield temporary
        # mkstemp makes files that only the owner can read.
        temporary.chmod(0o644)
        temporary.replace(path)
    except OSError as error:
        raise InputError(path, "out", "a file that can be written", error.strerror or error) from error
    finally:
        if temporary is not None:
            temporary.unlink(missing_ok=True)


def require_writable(path: str | Path, *read: Path) -> None:
    """Raise InputError unless a file can be written at ``path``, its folders made where they lack.

    read: files that the job reads, which it must not replace. Nothing is left: this is asked before long
    work starts.
    """
    path = Path(path)
    _require_replaceable(path)
    folder = next(parent for parent in path.absolute().parents if parent.exists())
    if not folder.is_dir():
        raise InputError(path, "out", "a path below a folder", f"the file {folder}")
    try:
        # What may be written by its mode need not take a file: /proc, or a disk that is read-only.
        tempfile.TemporaryFile(dir=folder).close()
    except OSError as error:
        expected = "a folder that may be written to"
        raise InputError(path, "out", expected, f"{folder}: {error.strerror}") from None
    for source in read:
        if path.exists() and source.exists() and path.samefile(source):
            raise InputError(path, "out", "another file than those that are read", source)


def _require_replaceable(path: Path) -> None:
    """Raise InputError for what is no plain file and must stay what it is: a folder, link, device or pipe."""
    try:
        if path.is_symlink():
            raise InputError(path, "out", "a file to write", f"a link to {path.readlink()}")
        if path.is_dir():
            raise InputError(path, "out", "a file to write", "a folder")
        if path.exists() and not path.is_file():
            raise InputError(path, "out", "a file to write", "a device or a pipe")
    # A name that is longer than the system's longest, or has a null character.
    except (OSError, ValueError) as error:
        raise InputError(path, "out", "the name of a file", getattr(error, "strerror", error)) from None


def require_file(path: Path, field: str, expected: str) -> None:
    """Raise InputError unless there is a file to read; expected: what it should be."""
    try:
        mode = path.stat().st_mode
    except FileNotFoundError:
        raise InputError(path, field, expected, "no such file") from None
    # A path through a file, one that is too long, or one with a null character.
    except (OSError, ValueError) as error:
        raise InputError(path, field, expected, getattr(error, "strerror", error)) from None
    if stat.S_ISDIR(mode):
        raise InputError(path, field, expected, "a folder")
    if not stat.S_ISREG(mode):
        raise InputError(path, field, expected, "no regular file")
    if not os.access(path, os.R_OK):
        raise InputError(path, field, expected, "a file that may not be read")


def is_file(path: Path) -> bool:
    """Whether there is such a file; False for a name that no file can have."""
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False


def read_json(path: Path) -> Any:
    """A JSON file's content. Raises InputError when it is none."""
    require_file(path, "file", "an existing JSON file")
    return read_bounded_json(path)


def write_json(document: Any, path: str | Path) -> None:
    """Write a JSON file, whole or not at all."""
    write_text(json.dumps(document, ensure_ascii=False, indent=1, allow_nan=False) + "\n", path)


def write_text(text: str, path: str | Path) -> None:
    """Write a text file, whole or not at all."""
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
