"""Progress of long work on stderr: shown on a terminal, silent otherwise."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskID, TextColumn, TimeElapsedColumn


class Steps:
    """The named steps of a job, with a bar for the one under way."""

    def __init__(self, progress: Progress):
        self._progress = progress

    @contextmanager
    def step(self, title: str) -> Iterator["Step"]:
        """A step that lasts as long as the block."""
        task = self._progress.add_task(title, total=None, note="")
        try:
            yield Step(self._progress, task)
        finally:
            self._progress.update(task, total=1, completed=1)


class Step:
    """One step; ``update`` may be called from any thread."""

    def __init__(self, progress: Progress, task: TaskID):
        self._progress, self._task = progress, task

    def update(self, done: float, total: float, note: str = "") -> None:
        """So much of ``total`` is done; ``note`` is shown beside the bar."""
        self._progress.update(self._task, completed=done, total=total, note=note)


@contextmanager
def steps() -> Iterator[Steps]:
    """Show the steps of a job while the block runs."""
    console = Console(stderr=True)
    columns = (
        TextColumn("{task.description:32}", markup=False),
        BarColumn(),
        TimeElapsedColumn(),
        TextColumn("{task.fields[note]}", markup=False),
    )
    with Progress(*columns, console=console, disable=not sys.stderr.isatty()) as progress:
        yield Steps(progress)
