"""The folder of a command's results: its own, one command's at a time, and nothing else's."""

import contextlib
import json
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

from identification.errors import InputError

# What says that a folder is ours, and which job's; locked while a command writes there.
MARK = ".testbench.json"
FORMAT = "testbench-results"


@contextmanager
def results_folder(out: Path, command: str, given: Any, written: Sequence[str]) -> Iterator[None]:
    """Keep ``out`` for one command while the block runs. Raises InputError where it is not to be had.

    given: what the results follow from, JSON-able. written: names of what the command writes. A folder that
    has one of them without being ours is refused, and so is one that another process writes to. A line on
    stderr says where results of another job were replaced. Where nothing was written, nothing stays.
    """
    require_plain_folder(out)
    made = [folder for folder in (out, *out.parents) if not folder.exists()]
    mark = out / MARK
    is_ours = mark.is_file()
    if not is_ours:
        for name in written:
            if (out / name).exists() or (out / name).is_symlink():
                expected = "a folder that is new, or whose files testbench has written"
                raise InputError(out, "out", expected, f"one that has a {name} of another making")
    try:
        out.mkdir(parents=True, exist_ok=True)
        file = mark.open("a+", encoding="utf-8")
    except OSError as error:
        raise InputError(out, "out", "a folder that may be written to", error.strerror or error) from None
    with file:
        _lock(file, out)
        try:
            yield
        except BaseException:
            if not is_ours and not any((out / name).exists() for name in written):
                mark.unlink(missing_ok=True)
                with contextlib.suppress(OSError):
                    for folder in made:
                        folder.rmdir()
            raise
        _sign(file, {"format": FORMAT, "command": command, "given": given}, out)


def require_plain_folder(out: Path) -> None:
    """Raise InputError for what is there and is no folder: a file, a link, a device, a pipe."""
    if out.is_symlink():
        raise InputError(out, "out", "a folder", f"a link to {out.readlink()}")
    if out.exists() and not out.is_dir():
        raise InputError(out, "out", "a path below a folder", f"the file {out.absolute()}")


def _lock(file: IO[str], out: Path) -> None:
    """Keep others from the folder as long as the file is open, which ends with the process."""
    try:
        import fcntl
    except ImportError:
        return
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        got = "one that another testbench is writing to; try again when it has ended"
        raise InputError(out, "out", "a folder that no other process writes to", got) from None
    # A file system without locks: nothing is known of others there.
    except OSError:
        return


def _sign(file: IO[str], job: dict[str, Any], out: Path) -> None:
    """Write whose results the folder has now; a line on stderr where it had another job's."""
    file.seek(0)
    text = file.read()
    job = json.loads(json.dumps(job, default=str))
    with contextlib.suppress(ValueError, RecursionError):
        before = json.loads(text) if text else job
        if before != job:
            command = before.get("command") if isinstance(before, dict) else None
            print(f"{out}: results of another {command or 'job'} were replaced", file=sys.stderr)
    file.truncate(0)
    file.write(json.dumps(job, indent=1) + "\n")
