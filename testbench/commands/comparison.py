"""What can be chosen, how the choices compare, and a look at a result."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from .options import AS_LOGGED, Chosen, Model, Processes, ScenarioSeed


def compare(
    question: Annotated[str, Parameter(help="criteria, estimators, differentiation or trajectories")],
    scenario: Annotated[
        Path | None, Parameter(help="scenario YAML; scenarios/compare_QUESTION.yaml when not given")
    ] = None,
    /,
    *,
    out: Annotated[Path, Parameter(help="folder for cases, CSV and report.html; a second call resumes")],
    jobs: Processes = None,
    scheduler: Annotated[
        str | None, Parameter(help="address of a Dask scheduler whose workers run the cases")
    ] = None,
    seed: ScenarioSeed = None,
) -> None:
    """Compare every choice over seeds and noise levels; resumable, in parallel."""
    from ..compare.case import require_question

    # What follows takes seconds to load.
    require_question(question)
    from ..compare.compare import WRITTEN
    from ..compare.compare import compare as run_comparison
    from ..containment.folder import results_folder

    with results_folder(out, WRITTEN, resumes=True):
        run_comparison(question, scenario, out, jobs, scheduler, seed)


def list_names(*, json: Annotated[bool, Parameter(help="for machines", negative=())] = False) -> None:
    """What can be chosen: models, estimators, differentiation, trajectories, criteria, effects."""
    from ..catalogue import print_catalogue

    print_catalogue(json)


def parity(*, model: Model, chosen: Chosen = AS_LOGGED) -> None:
    """Hold our torques and MuJoCo's on a model against Pinocchio's; needs the extra "parity"."""
    from ..jobs.parity import parity_of_model

    parity_of_model(model, chosen.choice())


def scenarios(
    *, out: Annotated[Path, Parameter(help="folder that gets scenarios/ and models/")] = Path()
) -> None:
    """Copy the scenarios and models that come with the program, to read and to change."""
    from ..shipped import copy_shipped

    copy_shipped(out)


def view(directory: Annotated[Path, Parameter(help="folder that run has written")], /) -> None:
    """Open a recorded Rerun session."""
    from ..jobs.view import view as open_session

    open_session(directory)
