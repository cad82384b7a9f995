"""The jobs behind ``diagnose`` and ``predict``: logs in, results folder out."""

from collections.abc import Mapping, Sequence
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from importlib import import_module
from pathlib import Path

import numpy as np

from identification.errors import InputError
from recordings.checks import require_sound
from testbench.effects import effects
from testbench.excitation_file import write_excitation
from testbench.files import require_writable
from testbench.log import Recording
from testbench.model_reading.reading import Choice
from testbench.progress import Steps, steps
from testbench.robot import Robot, load_robot, print_notes
from testbench.runs import by_path, read_runs, run_names

from .correction.closed_loop_gap import forward_gap, gap_as_given
from .correction.corrected_mjcf import Written, write_corrected
from .correction.correction_document import DOCUMENT
from .correction.forward_gap import ForwardGap
from .decision.findings import Diagnosis
from .diagnose import diagnose, diagnose_prepared
from .experiment.discriminating_motion import NextExperiment, next_experiment
from .fit.torque_alignment import aligned
from .report.document import write_diagnosis

# What is left in a folder of results.
WRITTEN = (
    "corrected.xml",
    "corrected_files",
    "diagnosis.json",
    "next_experiment.json",
    "report.html",
    "session.rrd",
)


def diagnose_logs(
    model: Path,
    logs: Sequence[Path],
    out: Path,
    without: Sequence[str] = (),
    seed: int = 0,
    jobs: int | None = None,
    cutoff: float | None = None,
    payloads: Sequence[str] = (),
    map_path: Path | None = None,
    choice: Choice | None = None,
    joint_names: Sequence[str] | None = None,
) -> tuple[Diagnosis, NextExperiment | None, Written]:
    """Diagnose the logs against the model; write everything to ``out``.

    without: effects taken out of the catalogue. seed: of the next experiment. jobs: threads. cutoff: Hz, no
    joint's band is wider; None for what its encoders leave. payloads: RUN=KG each, a payload of known mass
    that is in that run and in no other. map_path: how recordings that are no robot-logs are read. choice: of
    the model; joint_names, of the first log, are the robot's where it names none. Leaves corrected.xml,
    report.html, session.rrd, next_experiment.json where one helps, and diagnosis.json,
    which is written last. Raises InputError.
    """
    _require_valid(without, cutoff)
    require_writable(out / DOCUMENT)
    masses = dict(_stated(each, run_names(logs)) for each in payloads)
    robot = load_robot(model, choice, joint_names)
    print_notes(robot)
    recordings = dict(zip(run_names(logs), read_runs(logs, robot, map_path), strict=True))
    # Filters, simulation and most of a design are outside the interpreter, and look at nothing of the rest.
    with steps() as progress, ThreadPoolExecutor(1) as aside:
        prepared = aside.submit(aligned, robot, recordings, cutoff)
        findings = require_sound(robot, recordings, logs)
        as_given = aside.submit(gap_as_given, robot, recordings, jobs)
        # More than a second to import, which the diagnosis does not wait for.
        for name in (".report.page", ".report.session"):
            aside.submit(import_module, name, __package__)
        with progress.step("diagnose"):
            try:
                diagnosis = diagnose_prepared(prepared.result(), without, masses, findings)
            except InputError as error:
                raise by_path(error, logs) from None
        experiment, written = _write(diagnosis, recordings, out, seed, jobs, progress, aside, as_given)
    return diagnosis, experiment, written


def diagnose_runs(
    robot: Robot,
    recordings: Mapping[str, Recording],
    without: Sequence[str] = (),
    cutoff: float | None = None,
    payloads: Mapping[str, float] | None = None,
) -> Diagnosis:
    """Check the runs, by name, and diagnose them; nothing is written.

    without, cutoff: as of ``diagnose_logs``. payloads: kg, known to be in one run and in no other, by its
    name. Raises InputError.
    """
    _require_valid(without, cutoff)
    for name in payloads or ():
        if name not in recordings:
            raise InputError("diagnose", "payloads", "the name of a run", repr(name), recordings)
    findings = require_sound(robot, recordings, [Path(name) for name in recordings])
    return diagnose(robot, recordings, without, cutoff, payloads, findings)


def write_results(
    diagnosis: Diagnosis, recordings: Mapping[str, Recording], out: Path, seed: int = 0
) -> tuple[NextExperiment | None, Written]:
    """Write to ``out`` all that ``diagnose_logs`` leaves. recordings: those diagnosed. Raises InputError."""
    require_writable(out / DOCUMENT)
    with steps() as progress, ThreadPoolExecutor(1) as aside:
        as_given = aside.submit(gap_as_given, diagnosis.robot, recordings, None)
        return _write(diagnosis, recordings, out, seed, None, progress, aside, as_given)


def _write(
    diagnosis: Diagnosis,
    recordings: Mapping[str, Recording],
    out: Path,
    seed: int,
    jobs: int | None,
    progress: Steps,
    aside: Executor,
    as_given: Future[ForwardGap | None],
) -> tuple[NextExperiment | None, Written]:
    """Simulate the closed loop, find the next experiment, and write the folder. as_given: under way."""
    closed = aside.submit(forward_gap, diagnosis, recordings, as_given.result(), jobs)
    with progress.step("corrected simulator"):
        written = write_corrected(diagnosis, out / "corrected.xml")
    with progress.step("closed loop and next experiment"):
        experiment = next_experiment(diagnosis, seed)
        from .report.page import write_report
        from .report.session import write_session

        if experiment is not None and experiment.excitation is not None:
            assert experiment.file is not None
            write_excitation(experiment.excitation, out / experiment.file)
        write_session(diagnosis, out / "session.rrd", experiment)
        forward = closed.result()
    with progress.step("report"):
        write_report(diagnosis, out / "report.html", written, forward, experiment)
        write_diagnosis(diagnosis, out / DOCUMENT, written, forward, experiment)
    return experiment, written


def _require_valid(without: Sequence[str], cutoff: float | None) -> None:
    """Raise InputError for an effect that does not exist, or a frequency that none can be."""
    for name in without:
        if name not in effects():
            raise InputError("diagnose", "without", "the name of an effect", repr(name), effects())
    if cutoff is not None and not 0 < cutoff < np.inf:
        raise InputError("diagnose", "--cutoff", "a frequency above 0, Hz", f"{cutoff:g}")


def _stated(payload: str, runs: Sequence[str]) -> tuple[str, float]:
    """Run and mass, kg, of RUN=KG. Raises InputError for another form, and for a run that is not there."""
    run, _, mass = payload.rpartition("=")
    if run not in runs:
        raise InputError("diagnose", "--payload", "RUN=KG with the name of a run", repr(payload), runs)
    try:
        kilograms = float(mass)
    except ValueError:
        kilograms = 0.0
    if not 0 < kilograms < np.inf:
        raise InputError("diagnose", "--payload", "RUN=KG with a mass above 0", repr(payload))
    return run, kilograms
