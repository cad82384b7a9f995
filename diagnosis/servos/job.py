"""The job behind ``diagnose`` of logs without torque: logs in, results folder out."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from identification.errors import InputError
from identification.output_error.servo_run import ServoRun
from testbench.drives.corrected import write_corrected
from testbench.drives.document import DOCUMENT as ESTIMATE
from testbench.drives.document import Errors, drives_document
from testbench.drives.effects import drive_effects
from testbench.drives.reading import ServoLog, read_servo_logs
from testbench.drives.stated import GAIN_SPREAD, Servo, StatedDrive
from testbench.drives.words import remarks_on
from testbench.files import require_writable, write_json
from testbench.model_reading.reading import Choice
from testbench.progress import steps
from testbench.robot import Robot, load_robot, print_notes

from ..correction.correction_document import DOCUMENT
from .diagnose import diagnose_servos
from .document import servo_document
from .findings import ServoDiagnosis
from .page import write_servo_report

# What is left in a folder of results.
WRITTEN = ("corrected.xml", DOCUMENT, ESTIMATE, "report.html")
# Relative deviation of the gains of a drive in order, where none is stated: firmware counts exactly, and
# torque constants hold to some percent.
IN_ORDER = 0.03
# Effects that MJCF's servo and joint have a field for.
IN_MJCF = (
    "armature", "command_delay", "coulomb_friction", "damping_gain_error", "gain_error",
    "torque_constant_error", "torque_limit", "viscous_friction",
)  # fmt: skip


def diagnose_servo_logs(
    model: Path,
    logs: Sequence[Path],
    out: Path,
    stated: StatedDrive | None,
    without: Sequence[str] = (),
    jobs: int | None = None,
    map_path: Path | None = None,
    choice: Choice | None = None,
    joint_names: Sequence[str] | None = None,
) -> ServoDiagnosis:
    """Diagnose logs of position servos without torque against the model; write everything to ``out``.

    stated: the drives, where the logs do not say. without: effects that are not looked for. jobs: threads.
    Leaves corrected.xml, estimate.json (which ``predict`` reads), report.html, and diagnosis.json last.
    Raises InputError.
    """
    _require_effects(without)
    require_writable(out / DOCUMENT)
    robot = load_robot(model, choice, joint_names)
    print_notes(robot)
    read = read_servo_logs(logs, robot, stated, map_path)
    with steps() as progress:
        with progress.step("diagnose"):
            diagnosis = diagnose_servo_runs(robot, read, stated, without, jobs)
        with progress.step("report"):
            write_results(diagnosis, [log.run for log in read], out)
    return diagnosis


def diagnose_servo_runs(
    robot: Robot,
    logs: Sequence[ServoLog],
    stated: StatedDrive | None,
    without: Sequence[str] = (),
    jobs: int | None = None,
) -> ServoDiagnosis:
    """The diagnosis of logs of position servos; stated, without, jobs: as of ``diagnose_servo_logs``.

    Raises InputError.
    """
    _require_effects(without)
    is_spread_stated = stated is not None and stated.spread is not None
    servos = [log.servo if is_spread_stated else _in_order(log.servo) for log in logs]
    return diagnose_servos(robot, servos, [log.run for log in logs], without, jobs)


def write_results(diagnosis: ServoDiagnosis, runs: Sequence[ServoRun], out: Path) -> None:
    """Write corrected.xml, estimate.json, report.html and, last, diagnosis.json. runs: that it is of."""
    write_corrected(diagnosis.found, out / "corrected.xml")
    lacks = tuple(
        f"{drive_effects()[each.effect].title} at {', '.join(each.joints)}"
        for each in diagnosis.effects
        if each.effect not in IN_MJCF
    )
    errors = [Errors("validation", diagnosis.given, diagnosis.corrected)]
    write_json(drives_document(diagnosis.found, errors, remarks_on(diagnosis.found), ()), out / ESTIMATE)
    write_servo_report(diagnosis, runs, lacks, out / "report.html")
    write_json(servo_document(diagnosis, lacks), out / DOCUMENT)


def _require_effects(names: Sequence[str]) -> None:
    """Raise InputError for a name that no effect of a drive has."""
    for name in names:
        if name not in drive_effects():
            expected = "the name of an effect of a drive"
            raise InputError("diagnose", "without", expected, repr(name), drive_effects())


def _in_order(servo: Servo) -> Servo:
    """The servo with gains as well known as those of a drive in order, where its log does not say."""
    spread = np.where(servo.spread == GAIN_SPREAD, IN_ORDER, servo.spread)
    return replace(servo, spread=spread)
