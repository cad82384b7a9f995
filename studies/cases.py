"""Cases of a study worked on in parallel, each result a file, so that a second call resumes."""

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

from studies.runner import run_each
from testbench.files import read_json, write_json


def run_cases(
    work: Callable[[Any], dict[str, Any]], cases: Mapping[str, Any], folder: Path, jobs: int | None = None
) -> list[dict[str, Any]]:
    """The results of the cases in their order; those found in ``folder`` are not run again.

    work: can be pickled; its result is JSON-able. cases: by a key that names a file. jobs: processes, all
    cores when None. A case that fails does not stop the others; the first error is raised at the end.
    """
    places = [folder / f"{key}.json" for key in cases]
    left = [index for index, place in enumerate(places) if not place.is_file()]
    run_each(partial(_keep, work, tuple(cases.values()), tuple(places)), left, len(places), jobs, "cases")
    return [read_json(place) for place in places]


def _keep(
    work: Callable[[Any], dict[str, Any]], cases: tuple[Any, ...], places: tuple[Path, ...], index: int
) -> None:
    """Work on one case and write its result, whole or not at all."""
    write_json(work(cases[index]), places[index])
