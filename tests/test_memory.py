"""Allocations beyond the machine's memory raise MemoryError."""

import subprocess
import sys

import pytest

TOO_MUCH = """
import os
import numpy as np
from testbench.memory import LEAST, bound_memory
bound_memory()
part = max(os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"), LEAST) // 3
try:
    # Not touched, so that the machine is not asked for them.
    kept = [np.zeros(part, np.uint8) for _ in range(6)]
    print("given")
except MemoryError:
    print("refused")
"""


@pytest.mark.skipif(sys.platform != "linux", reason="other systems do not count a process's memory so")
def test_more_than_the_machine_has_is_refused_and_not_the_process_ended() -> None:
    done = subprocess.run([sys.executable, "-c", TOO_MUCH], capture_output=True, text=True, check=True)
    assert done.stdout == "refused\n"
