"""From logs to what is wrong with a model: diagnose, predict, and the loop closed."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from .options import AS_LOGGED, Chosen, Jobs, Model, ScenarioSeed, Seed, at_least_one


def diagnose(
    logs: Annotated[list[Path], Parameter(help="robot-log files", consume_multiple=True, negative=())],
    /,
    *,
    model: Model,
    out: Annotated[Path, Parameter(help="folder for diagnosis.json, corrected.xml and report.html")],
    without: Annotated[
        list[str] | None,
        Parameter(
            help="effects to leave out of the catalogue",
            consume_multiple=True,
            negative=(),
            validator=at_least_one("--without"),
        ),
    ] = None,
    chosen: Chosen = AS_LOGGED,
    seed: Seed = 0,
    jobs: Jobs = None,
) -> None:
    """Say why simulator and robot differ: where, which effect, how far it shrinks, what to do next."""
    from diagnosis.job import diagnose_logs

    told = diagnose_logs(model, logs, out, without or (), seed, jobs, choice=chosen.choice())
    # It is imported by then, behind the closed loop.
    from diagnosis.report import print_summary

    print_summary(*told)


def predict(
    log: Annotated[Path, Parameter(help="robot-log whose motion to predict along")],
    /,
    *,
    diagnosis: Annotated[Path, Parameter(help="folder that diagnose has written")],
    out: Annotated[Path, Parameter(help="HDF5 to write")],
) -> None:
    """Predict the torque along a log's motion by the corrected model; the log's torque is not read."""
    from diagnosis.predict import predict as predict_torque

    predict_torque(diagnosis, log, out)


def loop(
    scenario: Annotated[Path, Parameter(help="loop scenario YAML")],
    /,
    *,
    out: Annotated[
        Path, Parameter(help="folder for rounds, loop.json and report.html; a second call resumes")
    ],
    seed: ScenarioSeed = None,
    jobs: Jobs = None,
) -> None:
    """Close the loop on a simulated robot: diagnose, run the proposed motion, diagnose again."""
    from diagnosis.loop.job import close_loop

    close_loop(scenario, out, seed, jobs)
