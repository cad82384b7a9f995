"""The study: every robot model below a folder judged, and a table of what became of it."""

from dataclasses import asdict
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from identification.errors import InputError
from testbench.files import write_text

from ..cases import run_cases
from .judge import EFFECT, Outcome, judge


def study(models: Path, out: Path, jobs: int | None = None) -> list[Outcome]:
    """Judge every URDF below ``models``; leave robots.md in ``out``.

    A second call resumes from the results kept in out/results. Raises InputError where there are none.
    """
    # The small ones first, so that a study that is broken off has said most.
    found = sorted(models.rglob("*.urdf"), key=lambda path: (path.stat().st_size, path))
    if not found:
        raise InputError(models, "models", "a folder with URDF files in it", "none")
    cases = {str(path.relative_to(models)).replace("/", "__"): path for path in found}
    rows = run_cases(partial(_work, models), cases, out / "results", jobs)
    outcomes = [
        Outcome(**row | {key: tuple(row[key]) for key in ("notes", "healthy", "affected")}) for row in rows
    ]
    outcomes.sort(key=lambda each: each.model)
    write_text(table(outcomes), out / "robots.md")
    works = [each for each in outcomes if each.works]
    print(f"{out / 'robots.md'}: {len(works)} of {len(outcomes)} models work")
    return outcomes


def table(outcomes: list[Outcome]) -> str:
    """A Markdown table, a line a model."""
    lines = [
        f"| model | joints | works | speed, % of limit | named with {EFFECT} | why not, and what was said |",
        "| --- | --- | --- | --- | --- | --- |",
    ]
    for each in outcomes:
        reasons = [f"{each.stopped}: {each.reason}"] if each.stopped else []
        if each.healthy:
            reasons.append(f"healthy, but named: {', '.join(each.healthy)}")
        said = "; ".join([*reasons, *(note.split(": ", 1)[1] for note in each.notes)]).replace("|", "/")
        cells = [
            each.model,
            str(each.joints or ""),
            "yes" if each.works else "no",
            f"{100 * each.speed:.0f}" if each.joints else "",
            ", ".join(each.affected),
            said,
        ]
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def _work(models: Path, path: Path) -> dict[str, Any]:
    with TemporaryDirectory() as folder:
        return asdict(judge(path, str(path.relative_to(models)), Path(folder)))
