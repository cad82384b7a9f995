"""The jobs behind ``diagnose`` and ``predict``: logs in, results folder out."""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from importlib import import_module
from pathlib import Path

from identification.errors import InputError
from testbench.effects import effects
from testbench.excitation_file import write_excitation
from testbench.files import require_writable
from testbench.log import logged_joints
from testbench.model_reading.reading import Choice
from testbench.progress import steps
from testbench.robot import load_robot, print_notes
from testbench.runs import by_path, read_runs, run_names

from .diagnose import diagnose
from .discrimination import NextExperiment, next_experiment
from .document import write_diagnosis
from .findings import Diagnosis
from .forward import forward_gap, gap_as_given
from .predict import DOCUMENT
from .remedy import write_corrected


def diagnose_logs(
    model: Path,
    logs: Sequence[Path],
    out: Path,
    without: Sequence[str] = (),
    seed: int = 0,
    jobs: int | None = None,
    choice: Choice | None = None,
) -> tuple[Diagnosis, NextExperiment | None]:
    """Diagnose the logs against the model; write everything to ``out``.

    without: effects taken out of the catalogue. seed: of the next experiment. jobs: threads. choice: of the
    model; the logs' joints are the robot's where it names none. Leaves
    corrected.xml, report.html, session.rrd, next_experiment.json where one helps, and diagnosis.json,
    which is written last. Raises InputError.
    """
    for name in without:
        if name not in effects():
            raise InputError("diagnose", "without", "the name of an effect", repr(name), effects())
    require_writable(out / DOCUMENT)
    robot = load_robot(model, choice, logged_joints(logs[0]))
    print_notes(robot)
    recordings = dict(zip(run_names(logs), read_runs(logs, robot), strict=True))
    # Simulation and most of a design is outside the interpreter, and looks at nothing of the rest.
    with steps() as progress, ThreadPoolExecutor(1) as aside:
        as_given = aside.submit(gap_as_given, robot, recordings, jobs)
        # Most of a second to import, of which none is waited for here.
        aside.submit(import_module, ".report", __package__)
        with progress.step("diagnose"):
            try:
                diagnosis = diagnose(robot, recordings, without)
            except InputError as error:
                raise by_path(error, logs) from None
        with progress.step("corrected simulator"):
            not_in_mjcf = write_corrected(diagnosis, out / "corrected.xml")
        with progress.step("closed loop and next experiment"):
            closed = aside.submit(forward_gap, diagnosis, recordings, as_given.result(), jobs)
            experiment = next_experiment(diagnosis, seed)
            from .report import write_report, write_session

            if experiment is not None and experiment.excitation is not None:
                assert experiment.file is not None
                write_excitation(experiment.excitation, out / experiment.file)
            write_session(diagnosis, out / "session.rrd", experiment)
            forward = closed.result()
        with progress.step("report"):
            write_report(diagnosis, out / "report.html", not_in_mjcf, forward, experiment)
            write_diagnosis(diagnosis, out / DOCUMENT, not_in_mjcf, forward, experiment)
    return diagnosis, experiment
