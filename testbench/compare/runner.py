"""Cases run in parallel, each result a file: on the cores of this machine or on a Dask cluster."""

import json
import os
import sys
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, as_completed
from contextlib import contextmanager
from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from typing_extensions import TypedDict

from identification.errors import InputError

from ..containment.shape import require_shape
from ..files import read_json, write_text
from ..processes import process_pool
from .case import Case, Row, run_case

# How long a Dask scheduler may take to answer.
PATIENCE = "10s"


def run_cases(
    cases: Sequence[Case], folder: Path, jobs: int | None = None, scheduler: str | None = None
) -> list[Row]:
    """The rows of the cases in their order. Those found in ``folder`` are not run again.

    jobs: processes (all cores when None). scheduler: address of a Dask scheduler, whose workers run the
    cases instead; they need this package and the files of the cases. Raises InputError for a scheduler
    that does not answer.
    """
    places = [folder / f"{case.key}.json" for case in cases]
    left = [index for index, place in enumerate(places) if not place.is_file()]
    with _progress(len(cases), len(cases) - len(left)) as advance:
        if left:
            with _executor(min(jobs or os.cpu_count() or 1, len(left)), scheduler) as executor:
                running = {executor.submit(run_case, cases[index]): index for index in left}
                try:
                    for done in as_completed(running):
                        index = running[done]
                        _keep(cases[index], done.result(), places[index])
                        advance(f"{cases[index].choice} {cases[index].level}")
                except BaseException:
                    for future in running:
                        future.cancel()
                    raise
    return [_kept(place) for place in places]


def _keep(case: Case, row: Row, place: Path) -> None:
    """Write a finished case, whole or not at all."""
    document = {"question": case.question, "settings": case.settings, "row": row}
    write_text(json.dumps(document, ensure_ascii=False, indent=1), place)


class _Row(TypedDict):
    choice: str
    level: str
    seed: int
    note: str | None


class _Named(TypedDict):
    row: _Row


class _Kept(TypedDict):
    row: dict[str, float | int | str | None]


def _kept(place: Path) -> Row:
    """The row of a finished case. Raises InputError."""
    document = read_json(place)
    require_shape(place, _Named, document)
    return require_shape(place, _Kept, document)["row"]


@contextmanager
def _executor(workers: int, scheduler: str | None) -> Iterator[Executor]:
    if scheduler is None:
        with process_pool(workers) as pool:
            yield pool
        return
    # Slow to import.
    from distributed import Client

    try:
        client = Client(scheduler, timeout=PATIENCE)
    except (OSError, ValueError) as error:
        expected = "the address of a Dask scheduler that answers"
        raise InputError("compare", "--scheduler", expected, f"{scheduler}: {error}") from None
    with client:
        # A case is what its key says: the same one is never computed from another run's memory.
        yield client.get_executor(pure=False)


@contextmanager
def _progress(total: int, done: int) -> Iterator[Callable[[str], None]]:
    """Yields a function that counts one more case; shown on a terminal with the time left."""
    columns = (
        TextColumn("{task.description:30}", markup=False),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=Console(stderr=True), disable=not sys.stderr.isatty()) as progress:
        task = progress.add_task("cases", total=total, completed=done)
        yield lambda note: progress.update(task, advance=1, description=note)
