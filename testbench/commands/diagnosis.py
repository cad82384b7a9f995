"""From logs to what is wrong with a model: diagnose, predict, and the loop closed."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from identification.errors import InputError

from .options import AS_LOGGED, AS_STATED, Chosen, Drives, Jobs, Map, Model, ScenarioSeed, Seed, at_least_one


def diagnose(
    logs: Annotated[
        list[Path], Parameter(help="robot-logs, or recordings", consume_multiple=True, negative=())
    ],
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
    cutoff: Annotated[
        float | None,
        Parameter(help="Hz, no joint's band is wider; by default as its encoder lets"),
    ] = None,
    payload: Annotated[
        list[str] | None,
        Parameter(
            help="RUN=KG: that run carries this mass and the others do not; determines the drives' gains",
            consume_multiple=True,
            negative=(),
            validator=at_least_one("--payload"),
        ),
    ] = None,
    map: Map = None,
    chosen: Chosen = AS_LOGGED,
    drives: Drives = AS_STATED,
    seed: Seed = 0,
    jobs: Jobs = None,
) -> None:
    """Say why simulator and robot differ: where, which effect, how far it shrinks, what to do next.

    Of drives without measured torque, in position: the closed loop is simulated on the log's command.
    """
    from testbench.containment.folder import results_folder

    from ..runs import first_look

    stated, choice = drives.stated(), chosen.choice()
    look = first_look(logs[0], model, choice, map)
    if stated is not None or look.servo:
        from diagnosis.servos.job import WRITTEN as WRITTEN_OF_SERVOS
        from diagnosis.servos.job import diagnose_servo_logs
        from diagnosis.servos.words import print_servo_summary

        if cutoff is not None or payload:
            option = "--payload" if payload else "--cutoff"
            expected, got = "logs with torque", "a loop that is simulated, which has none"
            raise InputError("testbench", option, expected, got)
        with results_folder(out, WRITTEN_OF_SERVOS):
            found = diagnose_servo_logs(
                model, logs, out, stated, without or (), jobs, map, choice, look.joint_names
            )
        print_servo_summary(found)
        return
    from diagnosis.job import WRITTEN, diagnose_logs

    with results_folder(out, WRITTEN):
        answer = diagnose_logs(
            model,
            logs,
            out,
            without or (),
            seed,
            jobs,
            cutoff,
            payload or (),
            map,
            choice,
            look.joint_names,
        )
    # It is imported by then, behind the closed loop.
    from diagnosis.report.summary import print_summary

    print_summary(*answer)


def predict(
    log: Annotated[Path, Parameter(help="robot-log, or recording, whose motion to predict along")],
    /,
    *,
    diagnosis: Annotated[
        Path, Parameter(help="folder that diagnose has written, or identify of drives without torque")
    ],
    out: Annotated[Path, Parameter(help="HDF5 to write")],
    raw: Annotated[
        bool, Parameter(help="at all frequencies, not in each joint's band alone", negative=())
    ] = False,
    repeat: Annotated[
        Path | None, Parameter(help="another run of the same command: how well the robot repeats itself")
    ] = None,
    drives: Drives = AS_STATED,
    map: Map = None,
) -> None:
    """Predict the torque along a log's motion by the corrected model; the log's torque is not read.

    Of drives without measured torque, the position: the closed loop is simulated on the log's command.
    """
    from testbench.drives.document import is_drives

    if is_drives(diagnosis):
        from testbench.drives.job import predict_position

        predict_position(diagnosis, log, out, drives.stated(), map, repeat)
        return
    from diagnosis.correction.prediction import predict as predict_torque

    predict_torque(diagnosis, log, out, raw, map)


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
    from studies.loop.job import WRITTEN, close_loop
    from testbench.containment.folder import results_folder

    with results_folder(out, WRITTEN, resumes=True):
        close_loop(scenario, out, seed, jobs)
