"""The jobs behind ``blind make`` and ``blind score``."""

import csv
from collections.abc import Sequence
from functools import partial
from pathlib import Path

from diagnosis.correction.correction_document import DOCUMENT
from diagnosis.correction.prediction import read_diagnosed
from identification.errors import InputError
from testbench.files import read_json, replacing, require_writable, write_json
from testbench.log import read_log

from ..runner import run_each
from .case import SEALED, make_case, places
from .draw import case_names, kinds_of
from .hidden import hidden_error
from .judge import Row, closed, judge
from .page import write_page
from .scenario import BlindScenario, load_blind_scenario
from .seal import ANSWERS, MANIFEST, opened, seal
from .verdict import score_document, verdict

SCORE, TABLE, REPORT = "score.json", "cases.csv", "report.html"
SCORES = (SCORE, TABLE, REPORT)


def make(scenario_file: Path, out: Path, seed: int | None = None, jobs: int | None = None) -> None:
    """Draw and simulate the cases of a scenario below ``out``, and seal their answers; a second call resumes.

    Where all are sealed it says so, and changes nothing. Leaves cases/, sealed/ and manifest.json. Raises
    InputError, also for a folder of another scenario or seed.
    """
    scenario = load_blind_scenario(scenario_file, seed)
    require_writable(out / SEALED / ANSWERS)
    begun = out / SEALED / "scenario.json"
    if (out / MANIFEST).exists() and not begun.is_file():
        raise InputError(out, "out", "a folder of this scenario's cases", f"another {MANIFEST}")
    same_scenario(scenario, begun)
    names = case_names(len(kinds_of(scenario)))
    if (out / MANIFEST).exists():
        print(f"{out}: all {len(names)} cases are sealed already")
        return
    left = [index for index, name in enumerate(names) if not places(out, name).answer.is_file()]
    run_each(partial(_make, scenario, out), left, len(names), jobs, "cases made")
    seal(out, names)
    print(f"{out}: {len(names)} cases made and sealed")


def _make(scenario: BlindScenario, out: Path, index: int) -> None:
    make_case(scenario, index, out)


def same_scenario(scenario: BlindScenario, path: Path) -> None:
    """Write what the cases below a folder follow from. Raises InputError where they followed from other."""
    content = scenario.model_dump(mode="json", exclude={"robots"})
    content["robots"] = [
        robot.model_dump(mode="json", exclude={"model"}) | {"model": robot.model.name}
        for robot in scenario.robots
    ]
    if not path.is_file():
        write_json(content, path)
    elif read_json(path) != content:
        raise InputError(path, "scenario", "the scenario and seed that the folder was begun with", "another")


def score(cases: Path, diagnoses: Path, out: Path) -> list[str]:
    """Open the answers, judge DIAGNOSES/case_0001/diagnosis.json and so on, and write the scores.

    Returns the verdict, a line a goal. Raises InputError for files that are not what was sealed.
    """
    require_writable(out / SCORE)
    rows = []
    for answer in opened(cases):
        path = diagnoses / answer["case"] / DOCUMENT
        document = read_json(path)
        row = judge(answer, document, path)
        errors = None
        if isinstance(document, dict) and document.get("correction") is not None:
            place = places(cases, answer["case"])
            found = hidden_error(read_diagnosed(path.parent), read_log(place.hidden))
            errors = {"parameters": found.parameters.tolist(), "effects": found.corrected.tolist()}
        rows.append(row | closed(answer, errors))
    return write_scores(rows, out)


def write_scores(rows: Sequence[Row], out: Path) -> list[str]:
    """Write score.json, cases.csv and report.html of judged cases; print and return the verdict."""
    lines = verdict(rows)
    write_json(score_document(rows), out / SCORE)
    _write_table(rows, out / TABLE)
    write_page(rows, lines, out / REPORT)
    for line in lines:
        print(line.sentence)
    return [line.sentence for line in lines]


def _write_table(rows: Sequence[Row], path: Path) -> None:
    """One line a case; what is unknown is empty."""
    names = [name for name in rows[0] if name not in ("calibration", "draws")] if rows else []
    with replacing(path) as temporary, temporary.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, names, extrasaction="ignore")
        writer.writeheader()
        writer.writerows(rows)
