"""Work on a stranger's file, done in a process that may hang, crash or ask for all memory."""

import atexit
import contextlib
import json
import os
import queue
import signal
import subprocess
import sys
import threading
from pathlib import Path
from typing import Any

from identification.errors import InputError

from ..blas import BLAS_THREADS
from .wire import BrokenMessageError, receive, send

# Seconds to read what takes a good file a tenth of one, and bytes a second of a slow disk.
PATIENCE, SLOWEST_DISK = 8.0, 5e6
# Seconds until the process has imported what it needs, on a machine that is busy.
STARTING = 120.0
# Seconds until a process whose answer broke off has an exit status.
ENDING = 2.0
START = (
    "import json, sys; sys.path[:] = json.loads(sys.argv[1]); "
    "from testbench.containment.reader import serve; serve(int(sys.argv[2]))"
)
# Signals that end a process at its limit of processor time.
OUT_OF_TIME = [-getattr(signal, name) for name in ("SIGXCPU",) if hasattr(signal, name)]


class _Child:
    """A process that works on files, one at a time, until it is ended."""

    def __init__(self) -> None:
        # The system signals a child at the end of the thread that made it, which must be the last one.
        lasting = threading.current_thread() is threading.main_thread()
        self.process = subprocess.Popen(
            [sys.executable, "-c", START, json.dumps(sys.path), str(os.getpid() if lasting else 0)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            # Memory for a thread a core would count against its limit.
            env=os.environ | {BLAS_THREADS: "1"},
        )
        self.is_ready = False

    def ask(self, function: str, arguments: tuple[Any, ...], seconds: float) -> tuple[bool, Any]:
        """Whether it was done, and the value. Raises BrokenMessageError, or TimeoutError.

        seconds: of the processor, and of waiting for anything else.
        """
        if not self.is_ready:
            # Its imports are no work on the file.
            self._exchange("builtins:len", ((),), STARTING)
            self.is_ready = True
        return self._exchange(function, arguments, seconds)

    def _exchange(self, function: str, arguments: tuple[Any, ...], seconds: float) -> tuple[bool, Any]:
        stdin, stdout = self.process.stdin, self.process.stdout
        assert stdin is not None
        assert stdout is not None
        answers: queue.SimpleQueue[Any] = queue.SimpleQueue()

        def listen() -> None:
            try:
                answers.put(receive(stdout))
            # Whatever it is, the other thread waits for it.
            except Exception as error:
                answers.put(error)

        threading.Thread(target=listen, daemon=True).start()
        try:
            send(stdin, (_standing(), function, arguments, seconds))
        except OSError as error:
            raise BrokenMessageError(str(error)) from None
        answer = self._awaited(answers, seconds)
        if isinstance(answer, MemoryError):
            raise answer
        if not isinstance(answer, tuple) or len(answer) != 2:
            raise BrokenMessageError(str(answer))
        return answer

    def _awaited(self, answers: queue.SimpleQueue[Any], seconds: float) -> Any:
        """An answer; raises TimeoutError where none comes from a process that waits.

        One that works is ended by its limit of processor time, however little of it a busy machine gives.
        """
        while True:
            try:
                return answers.get(timeout=seconds)
            except queue.Empty:
                if not _works(self.process.pid):
                    raise TimeoutError from None

    def status(self) -> int:
        """The exit status of a process that has stopped answering."""
        with contextlib.suppress(subprocess.TimeoutExpired):
            return self.process.wait(ENDING)
        self.process.kill()
        return self.process.wait()

    def end(self) -> None:
        """End the process, whatever it does."""
        self.process.kill()
        self.process.wait()
        for stream in (self.process.stdin, self.process.stdout):
            # What was not sent cannot be any more.
            with contextlib.suppress(OSError):
                stream.close()  # type: ignore[union-attr]  # both are pipes


def _works(process: int) -> bool:
    """Whether a process would go on if it were given a core; no, where the system does not say."""
    try:
        status = Path(f"/proc/{process}/stat").read_text(encoding="utf-8", errors="replace")
    except OSError:
        return False
    # The name is in brackets, and may have such in it.
    return status.rpartition(")")[2].split()[0] in "RD"


_child: _Child | None = None
_one_at_a_time = threading.Lock()
# Files that a function hung or crashed on, as they were then, and in what way: once is enough to wait.
_broke: dict[tuple[object, ...], str] = {}


def begin() -> None:
    """Start the process in advance, so that it is there when the first file is read."""
    with _one_at_a_time:
        _started()


def contained(function: str, path: Path, field: str, expected: str, *arguments: Any, size: int = 0) -> Any:
    """What ``function`` (``module:name``) returns of ``path`` and the arguments, called in another process.

    Arguments and the value are plain values, arrays, or what wire.py lists. size: bytes to read, which may
    take as long as a slow disk does. Raises InputError, of ``field`` and ``expected``, where the function
    raises anything, ends the process, or takes too long or too much memory; at once where it did so before.
    """
    global _child
    seconds = PATIENCE + size / SLOWEST_DISK
    with _one_at_a_time:
        known = (function, *_state(path))
        if known in _broke:
            raise InputError(path, field, expected, _broke[known])
        child = _started()
        try:
            done, value = child.ask(function, (str(path), *arguments), seconds)
        except BaseException as error:
            _child = None
            got = _why(error, child, seconds)
            child.end()
            if got is None:
                raise
            if not isinstance(error, MemoryError):
                _broke[known] = got
            raise InputError(path, field, expected, got) from None
    if done:
        return value
    if isinstance(value, InputError):
        raise value
    # What a library leaves behind after such a file may trouble the next one.
    end()
    raise InputError(path, field, expected, value)


def _state(path: Path) -> tuple[object, ...]:
    """The file and when it was changed; whatever cannot be looked at is its name alone."""
    try:
        status = path.stat()
    except (OSError, ValueError):
        return (str(path.absolute()),)
    return str(path.absolute()), status.st_ino, status.st_mtime_ns, status.st_size


def _why(error: BaseException, child: _Child, seconds: float) -> str | None:
    """Why a file was not read, in words; None where the file is not the reason."""
    if isinstance(error, TimeoutError):
        return f"a file that takes over {seconds:.0f} s to read" if child.is_ready else None
    if isinstance(error, MemoryError):
        return "more than this machine's memory holds"
    if not isinstance(error, BrokenMessageError) or not child.is_ready:
        return None
    status = child.status()
    if status in OUT_OF_TIME:
        return f"a file that takes over {seconds:.0f} s to read"
    return f"a file that the library for it crashes on (exit status {status})"


def _standing() -> str:
    """The folder that relative paths start from."""
    try:
        return os.getcwd()  # noqa: PTH109  Path.cwd() is the same call
    except OSError:
        return "/"


def _started() -> _Child:
    global _child
    # One that has ended by itself, as when the thread that made it did, is no loss.
    if _child is None or _child.process.poll() is not None:
        _child = _Child()
    return _child


@atexit.register
def end() -> None:
    """End the process; another one is started where it is needed."""
    global _child
    with _one_at_a_time:
        if _child is not None:
            _child.end()
        _child = None
