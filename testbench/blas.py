"""Linear algebra on one thread: sums of a threaded BLAS depend on how many threads there are."""

import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from typing import Any

BLAS_THREADS = "OPENBLAS_NUM_THREADS"

_lock = threading.Lock()
_limit: Any = None
_users = 0


def keep_blas_single() -> None:
    """Keep this process, and those that it starts, on one thread. To be called before numpy is loaded."""
    os.environ[BLAS_THREADS] = "1"


@contextmanager
def single_blas_thread() -> Iterator[None]:
    """Keep BLAS on one thread inside the block, for all threads of this process; afterwards as it was."""
    global _limit, _users
    with _lock:
        if _users == 0:
            # Loaded later, it would bring a BLAS of its own that has not heard of the limit.
            import_module("scipy.linalg")
            from threadpoolctl import threadpool_limits

            _limit = threadpool_limits(1, user_api="blas")
        _users += 1
    try:
        yield
    finally:
        with _lock:
            _users -= 1
            if _users == 0:
                _limit.restore_original_limits()
