"""A bound on this process's memory: allocations beyond the machine's raise MemoryError."""

import os
import sys

# Bytes that libraries reserve and never use, beside what is used; and the least that any command gets.
RESERVED, LEAST = 1 << 30, 1 << 32


def bound_memory() -> None:
    """Let allocations beyond the machine's memory fail, on Linux, where the system would end the process."""
    if sys.platform != "linux":
        return
    import resource

    physical = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    soft, hard = resource.getrlimit(resource.RLIMIT_DATA)
    stated = [limit for limit in (soft, hard) if limit != resource.RLIM_INFINITY]
    resource.setrlimit(resource.RLIMIT_DATA, (min([max(physical + RESERVED, LEAST), *stated]), hard))
