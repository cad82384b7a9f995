"""Withheld effects: cases made, scored, and studied."""

from pathlib import Path
from typing import Annotated

from cyclopts import App, Parameter

from .options import Processes, ScenarioSeed

app = App(name="blind", help="Withheld effects: sealed cases, and how often the diagnosis finds them.")

BlindScenario = Annotated[Path, Parameter(help="blind scenario YAML")]


@app.command(name="make")
def blind_make(
    scenario: BlindScenario,
    /,
    *,
    out: Annotated[
        Path, Parameter(help="folder for cases/, sealed/ and manifest.json; a second call resumes")
    ],
    seed: ScenarioSeed = None,
    jobs: Processes = None,
) -> None:
    """Draw and simulate cases, and seal their answers."""
    from studies.blind.jobs import make
    from testbench.containment.folder import results_folder

    with results_folder(out, ("cases", "sealed", "manifest.json"), resumes=True):
        make(scenario, out, seed, jobs)


@app.command(name="score")
def blind_score(
    cases: Annotated[Path, Parameter(help="folder that blind make has written")],
    /,
    *,
    diagnoses: Annotated[Path, Parameter(help="folder with case_0001/diagnosis.json and so on")],
    out: Annotated[Path, Parameter(help="folder for score.json, cases.csv and report.html")],
) -> None:
    """Open the sealed answers and score the diagnoses."""
    from studies.blind.jobs import SCORES, score
    from testbench.containment.folder import results_folder

    with results_folder(out, SCORES):
        score(cases, diagnoses, out)


@app.command(name="study")
def blind_study(
    scenario: BlindScenario,
    /,
    *,
    out: Annotated[Path, Parameter(help="folder for results and scores; a second call resumes")],
    without: Annotated[
        str | None, Parameter(help="effect to leave out of the catalogue; same: each single case's own")
    ] = None,
    keep_logs: Annotated[bool, Parameter(help="keep the cases, to diagnose them again", negative=())] = False,
    seed: ScenarioSeed = None,
    jobs: Processes = None,
) -> None:
    """Make, diagnose and score every case of a scenario; resumable, in parallel."""
    from studies.blind.jobs import SCORES
    from studies.blind.study import study
    from testbench.containment.folder import results_folder

    with results_folder(out, ("results", "scenario.json", *SCORES), resumes=True):
        study(scenario, out, seed, jobs, keep_logs, without)
