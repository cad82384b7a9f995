"""The job behind ``blind study``: make, diagnose and predict case by case, then score."""

import shutil
import time
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from diagnosis.correction.correction_document import DOCUMENT
from diagnosis.correction.prediction import read_diagnosed
from diagnosis.diagnose import diagnose
from diagnosis.report.document import write_diagnosis
from identification.errors import InputError
from testbench.containment.shape import require_shape
from testbench.effects import effects
from testbench.files import read_json, require_writable, write_json
from testbench.log import read_log
from testbench.robot import load_robot

from ..document_shapes import StudyResult
from ..runner import run_each
from .case import CASES, SEALED, Places, make_case, places
from .draw import case_names, kinds_of
from .hidden import hidden_error
from .jobs import same_scenario, write_scores
from .judge import Row, closed, judge
from .scenario import BlindScenario, load_blind_scenario
from .seal import MANIFEST

# ``without`` takes this, or the name of an effect.
SAME = "same"


@dataclass(frozen=True)
class Study:
    """Settings of every process of a study. without: an effect taken out of the catalogue, or SAME."""

    scenario: BlindScenario
    out: Path
    keep_logs: bool
    without: str | None

    @property
    def results(self) -> Path:
        """Folder of this study's results, a file a case, and of its scores."""
        return self.out if self.without is None else self.out / f"without_{self.without}"

    def result(self, name: str) -> Path:
        """The result of a case."""
        return self.results / "results" / f"{name}.json"


def study(
    scenario_file: Path,
    out: Path,
    seed: int | None = None,
    jobs: int | None = None,
    keep_logs: bool = False,
    without: str | None = None,
) -> list[str]:
    """Do what is left of a study, and score it; returns the verdict, a line a goal.

    keep_logs: the logs stay, so that deleted results are diagnosed again without making them. without:
    an effect that the diagnosis does not know, or ``same``: single cases only, each without its own, which
    are scored as unknown effects. Leaves results/, score.json, cases.csv and report.html in OUT, or in
    OUT/without_NAME. Raises InputError.
    """
    if without not in (None, SAME) and without not in effects():
        raise InputError("blind study", "--without", "an effect, or same", repr(without), (SAME, *effects()))
    scenario = load_blind_scenario(scenario_file, seed)
    require_writable(out / "scenario.json")
    if (out / MANIFEST).exists():
        raise InputError(out, "out", "a folder that is not sealed", MANIFEST)
    same_scenario(scenario, out / "scenario.json")
    plan = Study(scenario, out, keep_logs, without)
    kinds, names = kinds_of(scenario), case_names(len(kinds_of(scenario)))
    chosen = [index for index, kind in enumerate(kinds) if without != SAME or kind == "single"]
    left = [index for index in chosen if not plan.result(names[index]).is_file()]
    run_each(partial(work, plan), left, len(chosen), jobs, "cases")
    for folder in (plan.results / "diagnoses", out / CASES, out / SEALED):
        if folder.is_dir() and not any(folder.iterdir()):
            folder.rmdir()
    results = {plan.result(names[index]): read_json(plan.result(names[index])) for index in chosen}
    for path, result in results.items():
        require_shape(path, StudyResult, result)
    rows = [_row(result, without) for result in results.values()]
    return write_scores([row for row in rows if row is not None], plan.results)


def work(plan: Study, index: int) -> None:
    """One case: made unless it is there, diagnosed from what is given, predicted along the hidden run."""
    name = case_names(index + 1)[-1]
    place = places(plan.out, name)
    answer = make_case(plan.scenario, index, plan.out)
    own = [each["effect"] for each in answer["effects"]]
    without = own if plan.without == SAME else [] if plan.without is None else [plan.without]
    folder = plan.results / "diagnoses" / name
    began = time.perf_counter()
    _diagnose(place, tuple(without), folder)
    seconds = time.perf_counter() - began
    found = hidden_error(read_diagnosed(folder), read_log(place.hidden))
    document = read_json(folder / DOCUMENT)
    # The corrected model is large, and has been used.
    del document["correction"]
    result: dict[str, Any] = {
        "answer": answer,
        "diagnosis": document,
        "hidden": {
            "nominal": found.nominal.tolist(),
            "parameters": found.parameters.tolist(),
            "effects": found.corrected.tolist(),
        },
        "seconds": seconds,
    }
    write_json(result, plan.result(name))
    shutil.rmtree(folder)
    if not plan.keep_logs:
        shutil.rmtree(place.given)
        shutil.rmtree(place.sealed)


def _diagnose(place: Places, without: tuple[str, ...], folder: Path) -> None:
    """Write the diagnosis of what is given to ``folder``."""
    robot = load_robot(place.nominal)
    recordings = {path.stem: read_log(path) for path in place.logs}
    write_diagnosis(diagnose(robot, recordings, without), folder / DOCUMENT)


def _row(result: dict[str, Any], without: str | None) -> Row | None:
    """The judged case. A single effect that the diagnosis does not know makes it an unknown one.

    None for several effects of which it does not know one: no answer would be right.
    """
    answer = result["answer"]
    if without is not None and any(without in (SAME, each["effect"]) for each in answer["effects"]):
        if len(answer["effects"]) > 1:
            return None
        answer = answer | {"kind": "unknown"}
    row = judge(answer, result["diagnosis"], answer["case"])
    return row | closed(answer, result["hidden"]) | {"seconds": result["seconds"]}
