"""Files that are either complete or not there."""

import json
import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from identification.errors import InputError


@contextmanager
def replacing(path: str | Path) -> Iterator[Path]:
    """A temporary path beside ``path`` that takes its place when the block ends without an error."""
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(prefix=f".{path.stem}.", suffix=path.suffix, dir=path.parent)
    os.close(handle)
    temporary = Path(name)
    try:
        yield temporary
        # mkstemp makes files that only the owner can read.
        temporary.chmod(0o644)
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)


def require_writable(path: str | Path) -> None:
    """Raise InputError unless a file can be written at ``path``, its folders made where they lack.

    Nothing is made: this is asked before long work starts.
    """
    path = Path(path)
    if path.is_dir():
        raise InputError(path, "out", "a file to write", "a folder")
    folder = next(parent for parent in path.absolute().parents if parent.exists())
    if not folder.is_dir():
        raise InputError(path, "out", "a path below a folder", f"the file {folder}")
    if not os.access(folder, os.W_OK | os.X_OK):
        raise InputError(path, "out", "a folder that may be written to", f"{folder}, which may not")


def read_json(path: Path) -> Any:
    """A JSON file's content. Raises InputError when it is none."""
    if not path.is_file():
        raise InputError(path, "file", "an existing JSON file", "no such file")
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except (json.JSONDecodeError, UnicodeDecodeError) as error:
        raise InputError(path, "content", "JSON", str(error)) from None


def write_json(document: Any, path: Path) -> None:
    """Write a JSON file, whole or not at all."""
    text = json.dumps(document, ensure_ascii=False, indent=1, allow_nan=False)
    with replacing(path) as temporary:
        temporary.write_text(text + "\n", encoding="utf-8")
