"""report.html of a blind study: goals, figures with intervals, and the plots that show them."""

from collections.abc import Sequence
from pathlib import Path

from testbench.files import write_text
from testbench.report.page import plot, rendered, time_stamp

from . import figures
from .judge import Row
from .merit import (
    SPLITS,
    Share,
    confusion,
    detection_limits,
    rejections,
    reliability,
    risk_and_coverage,
    shares,
    unknown_by_effect,
)
from .verdict import Line


def write_page(rows: Sequence[Row], verdict: Sequence[Line], path: Path) -> None:
    """Write the page, whole or not at all."""
    by_split = {name: shares([row for row in rows if chosen(row)]) for name, chosen in SPLITS.items()}
    limits = detection_limits(rows)
    judged = [line for line in verdict if line.reached is not None]
    text = rendered(
        "blind.html",
        ("studies.blind", "testbench.report"),
        time_stamp(),
        cases=len(rows),
        reached=sum(bool(line.reached) for line in judged),
        judged=len(judged),
        verdict=verdict,
        splits=list(SPLITS),
        table=[
            (name, [_cell(by_split[split][name]) for split in SPLITS])
            for name in next(iter(by_split.values()))
        ],
        limits=[
            (
                name.replace("_", " "),
                limit.cases,
                [limit.severity_half, limit.severity_most, limit.torque_half, limit.torque_most],
            )
            for name, limit in limits.items()
        ],
        unknown=[(name.replace("_", " "), *found) for name, found in unknown_by_effect(rows).items()],
        rejected=[(name.replace("_", " "), found) for name, found in rejections(rows).items()],
        reliability=plot(
            "reliability",
            "Stated probability against how often it was so",
            figures.calibration(reliability(rows)),
        ),
        risk=plot("risk", "Risk against coverage", figures.risk(*risk_and_coverage(rows))),
        confusion=plot(
            "confusion",
            "What acts (rows) and what is named first (columns)",
            figures.confused(*confusion(rows)),
        ),
        severity=plot("severity", "Single effects: found or not, by severity", figures.by_severity(rows)),
        gap=plot("gap", "Share of the reducible gap closed on the hidden run", figures.closed(rows)),
        rows=rows,
    )
    write_text(text, path)


def _cell(found: Share) -> str:
    """A share with its interval."""
    if found.value is None or found.interval is None:
        return "–"
    low, high = found.interval
    return f"{found.value:.1%} [{low:.0%}, {high:.0%}] of {found.of}"
