"""Cases of a study worked on in parallel, each result a file, so that a second call resumes."""

import os
import sys
from collections.abc import Callable, Mapping
from concurrent.futures import as_completed
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from testbench.files import read_json, write_json
from testbench.processes import process_pool


def run_cases(
    work: Callable[[Any], dict[str, Any]], cases: Mapping[str, Any], folder: Path, jobs: int | None = None
) -> list[dict[str, Any]]:
    """The results of the cases in their order; those found in ``folder`` are not run again.

    work: can be pickled; its result is JSON-able. cases: by a key that names a file. jobs: processes, all
    cores when None. A case that fails does not stop the others; the first error is raised at the end.
    """
    places = {key: folder / f"{key}.json" for key in cases}
    left = [key for key, place in places.items() if not place.is_file()]
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    failures: list[Exception] = []
    with Progress(*columns, console=Console(stderr=True), disable=not sys.stderr.isatty()) as progress:
        task = progress.add_task("cases", total=len(places), completed=len(places) - len(left))
        if left:
            with process_pool(min(jobs or os.cpu_count() or 1, len(left))) as pool:
                running = {pool.submit(work, cases[key]): key for key in left}
                for done in as_completed(running):
                    try:
                        write_json(done.result(), places[running[done]])
                    except Exception as error:
                        failures.append(error)
                    progress.update(task, advance=1)
    if failures:
        raise failures[0]
    return [read_json(place) for place in places.values()]
