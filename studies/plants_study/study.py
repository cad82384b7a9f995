"""The study of independent plants: robots drawn, diagnosed from their logs, and scored by plant."""

import csv
import json
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from io import StringIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from diagnosis.diagnose import diagnose
from diagnosis.report.document import diagnosis_document
from identification.errors import InputError
from testbench.files import read_json, require_writable, write_json, write_text
from testbench.robot import load_robot
from testbench.runs import read_runs

from ..cases import run_cases
from ..plants import draw, plants
from ..plants.drawing import UNKNOWN
from .scoring import Bin, Share, calibration_error, reliability, risk_and_coverage

Row = dict[str, Any]

RESULTS, PAGE, TABLE, SCORES = "results", "plants.md", "plants.csv", "plants.json"
WRITTEN = (RESULTS, PAGE, TABLE, SCORES, "study.json")
# A fault that moves this share of its joint's torque is a larger one.
LARGE = 0.1
REFUSED = "refused"


@dataclass(frozen=True)
class Robot:
    """One robot of the study."""

    plant: str
    seed: int


def study(out: Path, robots: int = 60, seed: int = 0, jobs: int | None = None) -> dict[str, Any]:
    """Diagnose ``robots`` robots of every plant and score them; a second call resumes. Returns the scores.

    Leaves results/, plants.md, plants.csv and plants.json. Raises InputError for a folder of another study.
    """
    require_writable(out / SCORES)
    begun, settings = out / "study.json", {"robots": robots, "seed": seed, "plants": list(plants())}
    if not begun.is_file():
        write_json(settings, begun)
    elif read_json(begun) != settings:
        raise InputError(begun, "study", "the robots and seed that the folder was begun with", settings)
    cases = {
        f"{name}_{index:04d}": Robot(name, 10_000 * seed + index)
        for index in range(1, robots + 1)
        for name in plants()
    }
    rows = run_cases(work, cases, out / RESULTS, jobs)
    scores = scored(rows)
    write_json(scores, out / SCORES)
    for place, text in ((PAGE, page(scores)), (TABLE, _csv(rows))):
        write_text(text, out / place)
    print(f"{out / PAGE}: {len(rows)} robots")
    for line in headline(scores["all"]):
        print(line)
    return scores


def work(robot: Robot) -> Row:
    """Draw one robot, diagnose its logs, and hold what is said against its answer."""
    case = draw(robot.plant, robot.seed)
    with TemporaryDirectory() as folder:
        model, logs = case.write(Path(folder))
        began = time.perf_counter()
        try:
            known = load_robot(model)
            recordings = {log.stem: each for log, each in zip(logs, read_runs(logs, known), strict=True)}
            said = diagnosis_document(diagnose(known, recordings))
        except InputError as error:
            said = {"verdict": REFUSED, "effects": [], "why": str(error)}
        seconds = time.perf_counter() - began
    return judged(asdict(robot) | {"kind": case.kind}, [asdict(each) for each in case.faults], said) | {
        "seconds": seconds
    }


def judged(row: Row, faults: Sequence[dict[str, Any]], said: dict[str, Any]) -> Row:
    """The row of a case.

    first_right: the first name is a fault of the robot, at its joints. in_set: or it says that it
    cannot distinguish it from one, at the same joint. all_named: every fault has a name. wrong: names that
    are neither.
    """
    named = [
        {
            "effect": each["effect"],
            "joint": each.get("joint"),
            "into": each.get("parameters", {}).get("into"),
            "probability": each.get("probability"),
            "alike": list(each.get("confusable_with", ())),
        }
        for each in (said["effects"] if said["verdict"] == "effect" else [])
    ]
    real = [each for each in faults if each["effect"] != UNKNOWN]
    exact = [any(_same(name, each) for each in real) for name in named]
    stated = [any(_alike(name, each) for each in real) for name in named]
    return row | {
        "faults": list(faults),
        "share": min((each["share"] for each in faults), default=None),
        "verdict": said["verdict"],
        "why": said.get("why", ""),
        "named": named,
        "first_right": bool(exact and exact[0]),
        "in_set": bool(named and (exact[0] or stated[0])),
        "all_named": bool(real) and all(any(_same(name, each) for name in named) for each in real),
        "wrong": sum(not (a or b) for a, b in zip(exact, stated, strict=True)),
        "right": exact,
    }


def _joints(each: dict[str, Any]) -> frozenset[str]:
    return frozenset(name for name in (each["joint"], each["into"]) if name is not None)


def _same(name: dict[str, Any], fault: dict[str, Any]) -> bool:
    return bool(name["effect"] == fault["effect"] and _joints(name) == _joints(fault))


def _alike(name: dict[str, Any], fault: dict[str, Any]) -> bool:
    """Whether the fault is in the set that the diagnosis cannot distinguish from the name, at its joints."""
    there = not _joints(name) or not _joints(fault) or bool(_joints(name) & _joints(fault))
    return fault["effect"] in name["alike"] and there


# Figures by name: of which cases, and in which of them it holds.
FIGURES: dict[str, tuple[Callable[[Row], bool], Callable[[Row], bool]]] = {
    "larger singles, first name right": (
        lambda row: row["kind"] == "single" and row["share"] >= LARGE,
        lambda row: row["first_right"],
    ),
    "singles, first name right": (lambda row: row["kind"] == "single", lambda row: row["first_right"]),
    "singles, right or in the stated set": (lambda row: row["kind"] == "single", lambda row: row["in_set"]),
    "pairs, both named": (lambda row: row["kind"] == "pair", lambda row: row["all_named"]),
    "pairs, first name right": (lambda row: row["kind"] == "pair", lambda row: row["first_right"]),
    "unknown laws without a name": (lambda row: row["kind"] == "unknown", lambda row: not row["named"]),
    "unknown laws reported as unknown": (
        lambda row: row["kind"] == "unknown",
        lambda row: row["verdict"] == "unknown",
    ),
    "healthy robots with a name": (lambda row: row["kind"] == "healthy", lambda row: bool(row["named"])),
    "first names that are right": (lambda row: bool(row["named"]), lambda row: row["first_right"]),
    "robots with a wrong name": (lambda _: True, lambda row: row["wrong"] > 0),
    "refused": (lambda _: True, lambda row: row["verdict"] == REFUSED),
}


def scored(rows: Sequence[Row]) -> dict[str, Any]:
    """Figures of all plants and of each; JSON-able."""
    names = sorted({row["plant"] for row in rows})
    by_plant = {name: _figures([row for row in rows if row["plant"] == name]) for name in names}
    return {"all": _figures(rows), "plants": by_plant}


def _figures(rows: Sequence[Row]) -> dict[str, Any]:
    stated = [each["probability"] for row in rows for each in row["named"]]
    right = [so for row in rows for so in row["right"]]
    kept = [(p, so) for p, so in zip(stated, right, strict=True) if p is not None]
    probability, so = [p for p, _ in kept], [so for _, so in kept]
    first = [row["named"][0]["probability"] if row["named"] else None for row in rows]
    return {
        "robots": len(rows),
        "seconds": sum(row["seconds"] for row in rows),
        "shares": {name: _share(rows, *figure) for name, figure in FIGURES.items()},
        "calibration_error": calibration_error(probability, so),
        "reliability": [_bin(each) for each in reliability(probability, so)],
        "risk_and_coverage": risk_and_coverage(first, [row["first_right"] for row in rows]),
    }


def _share(rows: Sequence[Row], among: Callable[[Row], bool], holds: Callable[[Row], bool]) -> dict[str, Any]:
    inside = [row for row in rows if among(row)]
    share = Share(sum(holds(row) for row in inside), len(inside))
    return {"count": share.count, "total": share.total, "interval": list(share.interval)}


def _bin(each: Bin) -> dict[str, Any]:
    return {
        "stated": each.stated,
        "count": each.right.count,
        "total": each.right.total,
        "interval": list(each.right.interval),
    }


def headline(figures: dict[str, Any]) -> list[str]:
    """A line a figure."""
    lines = [f"{name}: {Share(each['count'], each['total'])}" for name, each in figures["shares"].items()]
    error = figures["calibration_error"]
    return [*lines, "expected calibration error: " + ("no name" if error is None else f"{error:.3f}")]


def page(scores: dict[str, Any]) -> str:
    """The scores in Markdown: a table of figures by plant, reliability, risk against coverage."""
    columns = {"all": scores["all"], **scores["plants"]}
    lines = [
        "# Independent plants",
        "",
        f"{scores['all']['robots']} robots. Intervals are Wilson's, 95 %.",
        "",
    ]
    lines += ["| figure | " + " | ".join(columns) + " |", "| --- " * (len(columns) + 1) + "|"]
    for name in FIGURES:
        cells = (
            Share(each["shares"][name]["count"], each["shares"][name]["total"]) for each in columns.values()
        )
        lines.append(f"| {name} | " + " | ".join(str(cell) for cell in cells) + " |")
    errors = (each["calibration_error"] for each in columns.values())
    calibration = ("none" if error is None else f"{error:.3f}" for error in errors)
    lines.append("| expected calibration error | " + " | ".join(calibration) + " |")
    lines += ["", "## Reliability", "", "| stated | right |", "| --- | --- |"]
    lines += [
        f"| {each['stated']:.0%} | {Share(each['count'], each['total'])} |"
        for each in scores["all"]["reliability"]
    ]
    lines += [
        "",
        "## Risk against coverage",
        "",
        "| share of robots with a name | wrong first names |",
        "| --- | --- |",
    ]
    lines += [f"| {coverage:.0%} | {risk:.0%} |" for coverage, risk in scores["all"]["risk_and_coverage"]]
    return "\n".join(lines) + "\n"


def _csv(rows: Sequence[Row]) -> str:
    text = StringIO()
    writer = csv.writer(text, lineterminator="\n")
    plain = (
        "plant",
        "seed",
        "kind",
        "share",
        "verdict",
        "first_right",
        "in_set",
        "all_named",
        "wrong",
        "seconds",
    )
    writer.writerow([*plain, "faults", "named"])
    for row in rows:
        faults = "; ".join(_label(each) for each in row["faults"])
        named = "; ".join(_label(each) + f" {json.dumps(each['probability'])}" for each in row["named"])
        writer.writerow([*(row[name] for name in plain), faults, named])
    return text.getvalue()


def _label(each: dict[str, Any]) -> str:
    places = [place for place in (each["joint"], each["into"]) if place]
    return " ".join([each["effect"], *places, *([f"({each['law']})"] if each.get("law") else [])])
