"""Processes that work on cases in parallel, and end with the one that started them."""

import multiprocessing
import os
import signal
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from types import FrameType

from .blas import keep_blas_single
from .containment.reader import end_with_parent

# s between a worker's looks for its parent.
BETWEEN_LOOKS = 0.5


@contextmanager
def process_pool(workers: int | None = None) -> Iterator[ProcessPoolExecutor]:
    """A pool of processes, each on one thread; workers: as many as there are cores when None.

    An exception that leaves the block, an interrupt and SIGTERM among them, ends the processes at once.
    """
    # Forking a process that has threads may hang.
    context = multiprocessing.get_context("spawn")
    with (
        ProcessPoolExecutor(workers, mp_context=context, initializer=_begin, initargs=(os.getpid(),)) as pool,
        _sigterm_raises(),
    ):
        try:
            yield pool
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            for process in multiprocessing.active_children():
                process.terminate()
            raise


def _begin(parent: int) -> None:
    """Set up a worker: the cases share the cores, not the parts of a case."""
    keep_blas_single()
    end_with_parent(parent)
    threading.Thread(target=_watch, args=(parent,), daemon=True).start()
    # A terminal interrupts every process; this one is ended by its parent.
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def _watch(parent: int) -> None:
    """End this process within a second of its parent, on systems that do not do it themselves."""
    while os.getppid() == parent:
        time.sleep(BETWEEN_LOOKS)
    os._exit(1)


@contextmanager
def _sigterm_raises() -> Iterator[None]:
    """SIGTERM raises SystemExit inside the block; its default leaves the workers behind."""

    def end(number: int, frame: FrameType | None) -> None:
        raise SystemExit(128 + number)

    # Only the main thread may say what a signal does.
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGTERM, end)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)
