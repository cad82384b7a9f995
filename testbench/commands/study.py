"""The standing judges: recordings of real robots, independent simulated plants, published models."""

from pathlib import Path
from typing import Annotated

from cyclopts import App, Parameter

from .options import Processes, Seed, at_least

app = App(
    name="study",
    help="The standing judges: recordings of real robots, independent simulated plants, published models.",
)


@app.command(name="recordings")
def study_recordings(
    plan: Annotated[Path, Parameter(help="plan YAML: which runs are fitted, which are predicted")],
    /,
    *,
    data: Annotated[Path, Parameter(help="folder that holds a folder a recording, as the plan names them")],
    out: Annotated[Path, Parameter(help="folder for recordings.md and .csv; a second call resumes")],
    jobs: Processes = None,
) -> None:
    """Diagnose recordings of real robots by some of their runs and predict another."""
    from studies.recordings.study import study
    from testbench.containment.folder import results_folder

    with results_folder(out, ("results", "recordings.md", "recordings.csv"), resumes=True):
        study(plan, data, out, jobs)


@app.command(name="plants")
def study_plants(
    *,
    out: Annotated[Path, Parameter(help="folder for plants.md, .csv and .json; a second call resumes")],
    robots: Annotated[int, Parameter(help="robots a plant", validator=at_least(1, "--robots"))] = 60,
    seed: Seed = 0,
    jobs: Processes = None,
) -> None:
    """Draw robots of every independent plant, diagnose their logs, and score what is said."""
    from studies.plants_study.study import WRITTEN, study
    from testbench.containment.folder import results_folder

    with results_folder(out, WRITTEN, resumes=True):
        study(out, robots, seed, jobs)


@app.command(name="robots")
def study_robots(
    models: Annotated[Path, Parameter(help="folder with URDFs in it, such as that of example-robot-data")],
    /,
    *,
    out: Annotated[Path, Parameter(help="folder for robots.md; a second call resumes")],
    jobs: Processes = None,
) -> None:
    """Take every published model from its file to a diagnosis, and say which work."""
    from studies.robots.study import study
    from testbench.containment.folder import results_folder

    with results_folder(out, ("results", "robots.md"), resumes=True):
        study(models, out, jobs)


@app.command(name="ablation")
def study_ablation(
    *,
    out: Annotated[Path, Parameter(help="folder for ablation.md and .json; a second call resumes")],
    robots: Annotated[int, Parameter(help="robots a plant", validator=at_least(1, "--robots"))] = 8,
    seed: Seed = 0,
    minutes: Annotated[float, Parameter(help="time for diagnoses without a rule")] = 60.0,
) -> None:
    """Neutralise each rule of the diagnosis in turn and tabulate the answers that it changes."""
    from studies.ablation.study import WRITTEN, study
    from testbench.containment.folder import results_folder

    with results_folder(out, WRITTEN, resumes=True):
        study(out, robots, seed, minutes)
