"""The process that strangers' files are read in: what it is asked is done within its limits.

It reads requests from standard input and answers on standard output until its parent closes either.
"""

import codecs
import contextlib
import ctypes
import importlib
import os
import signal
import sys
import time
from collections.abc import Iterator
from typing import IO, Any

from identification.errors import InputError

from .wire import BrokenMessageError, receive, send

# Bytes of address space: twice what the largest log takes, see hdf5.py.
MEMORY = 4 << 30
PR_SET_PDEATHSIG = 1
CODECS = ("ascii", "latin-1", "utf-8", "unicode_escape")


def end_with_parent(parent: int) -> None:
    """Have this process killed when its parent, of that id, dies; where the system cannot, nothing."""
    if sys.platform.startswith("linux"):
        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
        # It may have died before the call.
        if os.getppid() != parent:
            os._exit(1)


@contextlib.contextmanager
def no_more_files() -> Iterator[None]:
    """Let this process open no file inside the block, whatever the one that it has open asks for."""
    try:
        import resource
    except ImportError:
        yield
        return
    before = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (0, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, before)


def serve(parent: int) -> None:
    """Answer requests until there are no more: a function as ``module:name``, its arguments, and seconds.

    parent: id of the process to end with, or 0.
    """
    # The parent reports an interrupt.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if parent:
        end_with_parent(parent)
    # Plug-ins of HDF5 are code, loaded by what a file asks for.
    os.environ["HDF5_PLUGIN_PRELOAD"] = "::"
    requests, answers = os.fdopen(0, "rb", closefd=False), os.fdopen(os.dup(1), "wb")
    # What a library prints is no answer.
    os.dup2(2, 1)
    _confine()
    # Meanwhile the parent imports what it needs.
    for module in ("testbench.log", "testbench.robot"):
        importlib.import_module(module)
    # What a median, and a text that is decoded, load at a time when no file can be opened.
    importlib.import_module("numpy.ma")
    for codec in CODECS:
        codecs.lookup(codec)
    with contextlib.suppress(BrokenMessageError, BrokenPipeError):
        while True:
            _answer(requests, answers)


def _answer(requests: IO[bytes], answers: IO[bytes]) -> None:
    """Do one request. An answer is a pair: whether it was done, and the value or the InputError."""
    folder, function, arguments, seconds = receive(requests)
    os.chdir(folder)
    module, name = function.split(":")
    work = getattr(importlib.import_module(module), name)
    _limit_time(seconds)
    done, value = _tried(work, arguments)
    send(answers, (done, value))


def _tried(work: Any, arguments: tuple[Any, ...]) -> tuple[bool, Any]:
    try:
        return True, work(*arguments)
    except InputError as error:
        return False, error
    except MemoryError:
        return False, f"a file that takes over {MEMORY >> 30} GiB of memory to read"
    # Nothing is known of what a stranger's file raises; all of it means that the file cannot be read.
    except Exception as error:
        return False, f"{type(error).__name__}: {error}"


def _limit_time(seconds: float) -> None:
    """Limit processor time from now on: no loop in a library can be left from inside."""
    with contextlib.suppress(ImportError):
        import resource

        end = int(time.process_time() + seconds) + 1
        resource.setrlimit(resource.RLIMIT_CPU, (end, resource.getrlimit(resource.RLIMIT_CPU)[1]))


def _confine() -> None:
    """Limit memory; this process writes no file, and no core."""
    with contextlib.suppress(ImportError):
        import resource

        for kind, limit in (
            (resource.RLIMIT_AS, MEMORY),
            (resource.RLIMIT_CORE, 0),
            (resource.RLIMIT_FSIZE, 0),
        ):
            most = resource.getrlimit(kind)[1]
            resource.setrlimit(kind, (limit if most == resource.RLIM_INFINITY else min(limit, most), most))
