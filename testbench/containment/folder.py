"""The folder of a command's results: one command's at a time, and nobody else's files."""

import contextlib
import hashlib
import json
import os
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from identification.errors import InputError

# How a file that we have written begins, by the ending of its name.
BEGINNINGS = {
    ".xml": b"<mujoco",
    ".rrd": b"RRF",
    ".h5": b"\x89HDF\r\n\x1a\n",
}
WITHOUT_FORMAT = ("scenario.json", "score.json", "study.json", "plants.json")
# What every page of ours has in its head, and how far into a file that is looked for.
GENERATOR, HEAD = b'<meta name="generator" content="identification-testbench">', 4096


@contextmanager
def results_folder(out: Path, written: Sequence[str], resumes: bool = False) -> Iterator[None]:
    """Keep ``out`` for one command while the block runs. Raises InputError where it is not to be had.

    written: names of what the command writes. A folder is refused where one of them is there of another
    making, and while another process writes to it. A line on stderr says that earlier results were replaced;
    of a command that ``resumes``, those that are others now, as of another job. Folders made here go again
    where the block fails and leaves them empty.
    """
    require_plain_folder(out)
    there = [name for name in written if (out / name).exists() or (out / name).is_symlink()]
    for name in there:
        if not _is_ours(out / name):
            expected = "a folder that is new, or whose files testbench has written"
            raise InputError(out, "out", expected, f"one with a {name} of another making")
    before = {name: _digest(out / name) for name in there} if resumes else {}
    made = [folder for folder in (out, *out.parents) if not folder.exists()]
    try:
        out.mkdir(parents=True, exist_ok=True)
        with _locked(out):
            yield
    except OSError as error:
        _take_away(made)
        if error.filename is None or Path(str(error.filename)) not in made:
            raise
        raise InputError(out, "out", "a folder that may be written to", error.strerror or error) from None
    except BaseException:
        _take_away(made)
        raise
    replaced = [name for name in there if not resumes or before[name] != _digest(out / name)]
    if replaced:
        print(f"{out}: results that were there were replaced ({', '.join(replaced)})", file=sys.stderr)


def _digest(path: Path) -> bytes | None:
    """A digest of a file's content; None of a folder, which a command that resumes adds to."""
    if not path.is_file():
        return None
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").digest()


def require_plain_folder(out: Path) -> None:
    """Raise InputError for what is there and is no folder: a file, a link, a device, a pipe."""
    try:
        if out.is_symlink():
            raise InputError(out, "out", "a folder", f"a link to {out.readlink()}")
        if out.exists() and not out.is_dir():
            raise InputError(out, "out", "a path below a folder", f"the file {out.absolute()}")
    # A name that is longer than the system's longest, or has a null character.
    except (OSError, ValueError) as error:
        raise InputError(out, "out", "the name of a folder", getattr(error, "strerror", error)) from None


def _is_ours(path: Path) -> bool:
    """Whether a file is of the kind that we write under its name; a folder is."""
    if path.is_symlink():
        return False
    if path.is_dir():
        return not path.suffix
    if not path.is_file():
        return False
    try:
        with path.open("rb") as file:
            head = file.read(HEAD)
            if path.suffix == ".json":
                document = json.loads(head + file.read())
                return isinstance(document, dict) and (path.name in WITHOUT_FORMAT or "format" in document)
    except (OSError, ValueError, RecursionError):
        return False
    if path.suffix == ".html":
        return GENERATOR in head
    return head.lstrip().startswith(BEGINNINGS.get(path.suffix, b""))


@contextmanager
def _locked(out: Path) -> Iterator[None]:
    """Keep others from the folder in the block, or as long as this process lives."""
    try:
        import fcntl
    except ImportError:
        yield
        return
    handle = os.open(out, os.O_RDONLY)
    try:
        # A file system without locks does not show other processes.
        with contextlib.suppress(OSError):
            try:
                fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                got = "one that another testbench writes to now; try again when it has ended"
                raise InputError(out, "out", "a folder that no other process writes to", got) from None
        yield
    finally:
        os.close(handle)


def _take_away(made: Sequence[Path]) -> None:
    """Remove the folders that were made for results, innermost first, as far as they are empty."""
    with contextlib.suppress(OSError):
        for folder in made:
            folder.rmdir()
