"""The figures of a study held against what the diagnosis must reach, in words and for machines."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

from .judge import Row
from .merit import (
    SPLITS,
    Share,
    confusion,
    detection_limits,
    median_closed,
    rejections,
    reliability,
    risk_and_coverage,
    shares,
    unknown_by_effect,
)

# Figure: what it must reach by split, and whether more is better.
GOALS: dict[str, tuple[dict[str, float], bool]] = {
    "singles, first effect and joint right, severity .35 and up": ({"clean": 0.95, "background": 0.85}, True),
    "pairs, both effects found": ({"clean": 0.80, "background": 0.65}, True),
    "wrong name given": ({"clean": 0.03, "background": 0.07}, False),
    "healthy, false alarm": ({"clean": 0.02, "background": 0.02}, False),
    "unknown, reported as unknown": ({"all": 0.80}, True),
    "unknown, joint right": ({"all": 0.90}, True),
    "size of the effect within 15 %": ({"all": 0.80}, True),
    "at least 80 % of the gap closed": ({"all": 0.80}, True),
}
CALIBRATION_GOAL, CLOSED_GOAL = 0.05, 0.90


@dataclass(frozen=True)
class Line:
    """One goal: what was found in words, and whether it is reached; None where no case shows it."""

    sentence: str
    reached: bool | None


def verdict(rows: Sequence[Row]) -> list[Line]:
    """One line a goal."""
    by_split = {name: [row for row in rows if chosen(row)] for name, chosen in SPLITS.items()}
    found = {name: shares(members) for name, members in by_split.items()}
    lines = []
    for figure, (goals, more) in GOALS.items():
        for split, goal in goals.items():
            lines.append(_share_line(figure, split, found[split][figure], goal, more))
    error, middle = reliability(rows).error, median_closed(rows)
    lines.append(_number_line("expected calibration error", error, CALIBRATION_GOAL, False))
    lines.append(_number_line("median share of the reducible gap closed", middle, CLOSED_GOAL, True))
    return lines


def _share_line(figure: str, split: str, found: Share, goal: float, more: bool) -> Line:
    where = "" if split == "all" else f", {split}"
    bound = f"goal at {'least' if more else 'most'} {goal:.0%}"
    if found.value is None or found.interval is None:
        return Line(f"{figure}{where}: no case ({bound})", None)
    low, high = found.interval
    reached = found.value >= goal if more else found.value <= goal
    value = f"{found.value:.1%} ({found.count} of {found.of}, {low:.0%} to {high:.0%})"
    return Line(f"{figure}{where}: {value}; {bound}, {'reached' if reached else 'missed'}", reached)


def _number_line(figure: str, found: float | None, goal: float, more: bool) -> Line:
    bound = f"goal at {'least' if more else 'most'} {goal:g}"
    if found is None:
        return Line(f"{figure}: no case ({bound})", None)
    reached = found >= goal if more else found <= goal
    return Line(f"{figure}: {found:.3f}; {bound}, {'reached' if reached else 'missed'}", reached)


def score_document(rows: Sequence[Row]) -> dict[str, Any]:
    """score.json: every figure by split, and what the page shows."""
    figures: dict[str, dict[str, Any]] = {}
    for split, chosen in SPLITS.items():
        members = [row for row in rows if chosen(row)]
        for name, found in shares(members).items():
            figures.setdefault(name, {})[split] = _entry(found)
        figures.setdefault("median share of the reducible gap closed", {})[split] = median_closed(members)
        figures.setdefault("expected calibration error", {})[split] = reliability(members).error
    calibration = reliability(rows)
    coverage, risk = risk_and_coverage(rows)
    truths, names, counts = confusion(rows)
    return {
        "format": "blind-score",
        "format_version": 1,
        "cases": len(rows),
        "verdict": [asdict(line) for line in verdict(rows)],
        "figures": figures,
        "reliability": [
            {"stated": stated, **_entry(correct)}
            for stated, correct in zip(calibration.stated, calibration.correct, strict=True)
        ],
        "detection_limits": {
            name: {
                split: asdict(limit) | {"cases": _entry(limit.cases)}
                for split, chosen in SPLITS.items()
                if (limit := detection_limits([row for row in rows if chosen(row)]).get(name)) is not None
            }
            for name in detection_limits(rows)
        },
        "unknown_by_effect": {
            name: {"unknown": _entry(unknown), "joint": _entry(joint)}
            for name, (unknown, joint) in unknown_by_effect(rows).items()
        },
        "rejected": {name: asdict(found) for name, found in rejections(rows).items()},
        "risk_and_coverage": {"coverage": coverage.tolist(), "risk": risk.tolist()},
        "confusion": {"acts": truths, "said": names, "counts": counts.tolist()},
    }


def _entry(found: Share) -> dict[str, Any]:
    return {"value": found.value, "interval": found.interval, "count": found.count, "of": found.of}
