"""Cases worked on in parallel: one process a core, with the time left on a terminal."""

import os
import sys
from collections.abc import Callable, Sequence
from concurrent.futures import as_completed

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from testbench.processes import process_pool


def run_each(
    work: Callable[[int], None], left: Sequence[int], total: int, jobs: int | None, title: str
) -> None:
    """Call ``work`` for every index that is left of ``total``, each in some process; it leaves files.

    work: can be pickled. A case that fails does not stop the others; its error is raised at the end.
    """
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    console, hidden = Console(stderr=True), not sys.stderr.isatty()
    failures: list[Exception] = []
    with Progress(*columns, console=console, disable=hidden) as progress:
        task = progress.add_task(title, total=total, completed=total - len(left))
        if not left:
            return
        workers = min(jobs or os.cpu_count() or 1, len(left))
        with process_pool(workers) as pool:
            for done in as_completed([pool.submit(work, index) for index in left]):
                try:
                    done.result()
                except Exception as error:
                    failures.append(error)
                progress.update(task, advance=1)
    if failures:
        raise failures[0]
