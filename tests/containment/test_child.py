"""Work in another process: its limits, and what it may answer."""

import ctypes
import io
import os
import pickle
import subprocess
import time
from pathlib import Path

import numpy as np
import pytest

from identification.errors import InputError
from testbench.containment import child
from testbench.containment.child import contained
from testbench.containment.reader import no_more_files
from testbench.containment.wire import BrokenMessageError, receive, send

HERE = f"{__name__}:"
FILE = Path("strange.h5")


def crash(path: str) -> None:
    ctypes.string_at(0)


def loop(path: str) -> None:
    while True:
        pass


def sleep(path: str) -> None:
    time.sleep(1000)


def doze(path: str) -> str:
    time.sleep(0.5)
    return path


def swallow_memory(path: str) -> int:
    return len(bytes(1 << 40))


def read_another(path: str) -> bytes:
    with no_more_files():
        return Path(path).read_bytes()


def write(path: str) -> None:
    Path(path).write_text("written")


def double(path: str, values: np.ndarray) -> dict[str, object]:
    return {"path": path, "values": 2 * values, "empty": None}


def test_values_and_arrays_come_back() -> None:
    found = contained(HERE + "double", FILE, "log", "a log", np.arange(5.0))
    assert (found["path"], found["empty"]) == (str(FILE), None)
    np.testing.assert_array_equal(found["values"], 2 * np.arange(5.0))
    found["values"][0] = 7.0


@pytest.mark.parametrize(
    ("work", "says"),
    [
        ("crash", "the library for it crashes on"),
        ("loop", "takes over 1 s to read"),
        ("sleep", "takes over 1 s to read"),
        ("swallow_memory", "GiB of memory"),
    ],
)
def test_what_goes_wrong_is_one_line(work: str, says: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(child, "PATIENCE", 1.0)
    with pytest.raises(InputError, match=says) as error:
        contained(HERE + work, FILE, "log", "a log")
    assert str(error.value).startswith("strange.h5: log: expected a log, got ")


def test_a_reader_that_works_is_given_its_processor_time(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(child, "PATIENCE", 0.1)
    monkeypatch.setattr(child, "_works", lambda process: True)
    assert contained(HERE + "doze", FILE, "log", "a log") == str(FILE)


@pytest.mark.skipif(not Path("/proc/self/stat").is_file(), reason="the system does not say who works")
def test_a_process_works_unless_it_waits() -> None:
    assert child._works(os.getpid())
    with subprocess.Popen(["cat"], stdin=subprocess.PIPE) as waiting:
        deadline = time.monotonic() + 60
        while child._works(waiting.pid) and time.monotonic() < deadline:
            time.sleep(0.01)
        assert not child._works(waiting.pid)


def test_a_file_that_broke_the_reader_is_refused_at_once_until_it_changes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "strange.h5"
    path.write_text("one")
    with pytest.raises(InputError, match="crashes on"):
        contained(HERE + "crash", path, "log", "a log")
    monkeypatch.setattr(child, "_started", lambda: pytest.fail("it was tried again"))
    with pytest.raises(InputError, match="crashes on"):
        contained(HERE + "crash", path, "log", "a log")
    monkeypatch.undo()
    path.write_text("another")
    assert contained(HERE + "double", path, "log", "a log", np.zeros(1))["path"] == str(path)
    with pytest.raises(InputError, match="crashes on"):
        contained(HERE + "crash", path, "log", "a log")


@pytest.mark.skipif(os.name != "posix", reason="limits of a process are the system's")
def test_neither_another_file_is_opened_nor_one_written(tmp_path: Path) -> None:
    (tmp_path / "secret").write_text("secret")
    with pytest.raises(InputError, match="Too many open files"):
        contained(HERE + "read_another", tmp_path / "secret", "log", "a log")
    with pytest.raises(InputError, match="File too large"):
        contained(HERE + "write", tmp_path / "new", "log", "a log")
    assert not (tmp_path / "new").exists() or (tmp_path / "new").read_bytes() == b""


class _Runs:
    def __reduce__(self) -> tuple[object, tuple[str]]:
        return os.system, ("echo run",)


def test_an_answer_runs_no_code() -> None:
    stream = io.BytesIO()
    send(stream, _Runs())
    stream.seek(0)
    with pytest.raises(BrokenMessageError, match="in an answer"):
        receive(stream)
    assert pickle.loads(pickle.dumps(_Runs)) is _Runs
