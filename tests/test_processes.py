"""Interrupts and signals: what is said, and that no worker outlives the command."""

import os
import signal
import subprocess
import sys
import time

import pytest

from testbench.cli import main
from testbench.processes import process_pool

# What a shell runs in the background ignores interrupts, and so would the program.
AT_WORK = """
import os, signal, time
from testbench.processes import process_pool

signal.signal(signal.SIGINT, signal.default_int_handler)
with process_pool(2) as pool:
    pool.submit(os.getpid).result()
    asleep = [pool.submit(time.sleep, 300) for _ in range(3)]
    print("asleep", flush=True)
    for each in asleep:
        each.result()
"""


@pytest.mark.parametrize(("number", "code"), [(signal.SIGTERM, 143), (signal.SIGINT, 1)])
def test_no_worker_outlives_a_signal(number: signal.Signals, code: int) -> None:
    running = subprocess.Popen(
        [sys.executable, "-c", AT_WORK], stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )
    assert running.stdout is not None
    assert running.stdout.readline() == b"asleep\n"
    os.kill(running.pid, number)
    # Ends only once nobody holds standard output any more.
    running.communicate(timeout=60)
    assert running.returncode in (code, -number)


def test_no_worker_outlives_a_parent_that_is_killed() -> None:
    running = subprocess.Popen(
        [sys.executable, "-c", AT_WORK], stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )
    assert running.stdout is not None
    assert running.stdout.readline() == b"asleep\n"
    running.kill()
    began = time.monotonic()
    # Ends only once nobody holds standard output any more.
    running.communicate(timeout=60)
    assert time.monotonic() - began < 5


def test_a_pool_works_and_gives_sigterm_back() -> None:
    before = signal.getsignal(signal.SIGTERM)
    with process_pool(1) as pool:
        assert pool.submit(abs, -3).result() == 3
    assert signal.getsignal(signal.SIGTERM) is before


def test_an_interrupt_is_reported_in_one_line(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    def interrupted(as_json: bool) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("testbench.catalogue.print_catalogue", interrupted)
    with pytest.raises(SystemExit) as exit_:
        main(["list"])
    assert exit_.value.code == 130
    assert capfd.readouterr().err == "testbench: interrupted; what was finished is kept\n"
