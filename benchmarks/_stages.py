"""Run a scenario in this process and print the seconds of each of its stages as JSON."""

import contextlib
import json
import sys
import time
from collections.abc import Iterator
from pathlib import Path

BEGAN = time.perf_counter()


class StageClock:
    """Stands in for the progress display that ``testbench run`` reports its stages to."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}

    @contextlib.contextmanager
    def step(self, title: str) -> Iterator["StageClock"]:
        """Time the block."""
        start = time.perf_counter()
        yield self
        self.seconds[title.partition(": ")[2]] = time.perf_counter() - start

    def update(self, done: float, total: float, note: str = "") -> None:
        """Progress within a stage is not timed."""


def main() -> None:
    """Arguments: the scenario file and the folder for its results."""
    scenario, out = map(Path, sys.argv[1:])
    import testbench.jobs.run

    clock = StageClock()
    clock.seconds["import"] = time.perf_counter() - BEGAN

    @contextlib.contextmanager
    def steps() -> Iterator[StageClock]:
        yield clock

    testbench.jobs.run.steps = steps  # type: ignore[assignment]  # a clock in the display's place
    with contextlib.redirect_stdout(sys.stderr):
        testbench.jobs.run.run_scenario(scenario, out)
    print(json.dumps(clock.seconds))


if __name__ == "__main__":
    main()
