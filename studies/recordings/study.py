"""The study: every split of a plan judged, and a table of what came out."""

import csv
import math
from dataclasses import asdict
from io import StringIO
from pathlib import Path
from typing import Any

from testbench.files import write_text

from ..cases import run_cases
from .judge import STATED, Outcome, judge, wrong_names
from .plan import Split, load_plan

# A sentence longer than this is cut in the table.
SENTENCE = 160


def study(plan: Path, data: Path, out: Path, jobs: int | None = None) -> list[Outcome]:
    """Judge every split whose recording is below ``data``; leave recordings.md and recordings.csv in ``out``.

    A second call resumes from the results kept in out/results. Raises InputError.
    """
    splits = load_plan(plan, data)
    rows = run_cases(_work, {split.key: split for split in splits}, out / "results", jobs)
    outcomes = [_outcome(row) for row in rows]
    write_text(table(splits, outcomes), out / "recordings.md")
    write_text(_csv(outcomes), out / "recordings.csv")
    failed = [each for each in outcomes if each.error]
    worse = [each.worse_by for each in outcomes if not each.error and each.worse_by]
    wrong = [each for split, each in zip(splits, outcomes, strict=True) if wrong_names(split, each)]
    print(
        f"{out / 'recordings.md'}: {len(outcomes)} splits, {len(failed)} failed, {len(worse)} worse in some "
        f"column, by {max(worse, default=0.0):.2%} of the torque at most, {len(wrong)} with a wrong name of "
        f"{STATED:.0%} or more"
    )
    return outcomes


def table(splits: list[Split], outcomes: list[Outcome]) -> str:
    """A Markdown table, a line a split, errors in % of all joints' torque."""
    lines = [
        "| recording | fitted → predicted | given | re-identified | with effects | unfiltered |"
        " heaviest link | s | said | known |",
        "| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |",
    ]
    for split, each in zip(splits, outcomes, strict=True):
        errors = [_percent(value) for value in (each.given, each.parameters, each.effects, each.unfiltered)]
        cells = [each.recording, each.title, *errors, _number(each.heaviest), _number(each.seconds, 0)]
        lines.append("| " + " | ".join([*cells, _said(split, each), split.robot.known]) + " |")
    return "\n".join(lines) + "\n"


def _said(split: Split, outcome: Outcome) -> str:
    """The verdict with its names, or the error."""
    if outcome.error:
        return outcome.error.replace("|", "/")
    names = [
        f"{effect} {joint} {probability:.0%}".replace("  ", " ")
        for effect, joint, probability in outcome.named
    ]
    parts = [outcome.verdict + (": " + ", ".join(names) if names else "")]
    if not names:
        sentence = " ".join(outcome.sentence.split()).replace("|", "/")
        parts.append(sentence if len(sentence) <= SENTENCE else sentence[:SENTENCE] + " …")
    if outcome.log_warnings:
        parts.append("checks warn: " + ", ".join(each.replace("_", " ") for each in outcome.log_warnings))
    wrong = wrong_names(split, outcome)
    if wrong:
        parts.append("WRONG: " + ", ".join(wrong))
    if outcome.worse_by:
        parts.append(f"WORSE in a column, by {outcome.worse_by:.2%}")
    if outcome.warnings:
        parts.append(f"{len(outcome.warnings)} lines on stderr")
    return "; ".join(parts)


def _percent(share: float) -> str:
    return "" if math.isnan(share) else f"{100 * share:.4g} %"


def _number(value: float, digits: int = 2) -> str:
    return "" if math.isnan(value) else f"{value:.{digits}f}"


def _work(split: Split) -> dict[str, Any]:
    row = asdict(judge(split))
    # JSON has no NaN.
    return {
        key: None if isinstance(value, float) and math.isnan(value) else value for key, value in row.items()
    }


def _outcome(row: dict[str, Any]) -> Outcome:
    values: dict[str, Any] = {key: float("nan") if value is None else value for key, value in row.items()}
    named = tuple((effect, joint, probability) for effect, joint, probability in values["named"])
    tuples = {key: tuple(values[key]) for key in ("warnings", "log_warnings")}
    return Outcome(**values | tuples | {"named": named})


def _csv(outcomes: list[Outcome]) -> str:
    text = StringIO()
    writer = csv.DictWriter(text, fieldnames=list(asdict(outcomes[0])), lineterminator="\n")
    writer.writeheader()
    writer.writerows(asdict(each) for each in outcomes)
    return text.getvalue()
