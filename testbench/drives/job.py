"""The jobs of robots without measured torque: identify their drives, and predict their position."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from identification.errors import InputError
from identification.output_error.plant import limbs
from identification.output_error.servo_run import ServoRun
from identification.output_error.unknowns import EFFECTS
from recordings.checks.positions import require_plausible_motion

from ..files import require_writable, write_json
from ..log import Recording, check_joints, in_model_order, write_log
from ..model_reading.reading import Choice
from ..robot import load_robot, print_notes
from ..runs import read_motion
from ..terminal import console
from .corrected import write_corrected
from .differences import differences
from .document import DOCUMENT, Errors, ReadDrives, drives_document, read_drives
from .identified import IdentifiedDrives, identify_drives, position_rms, simulated, split
from .reading import ServoLog, read_servo_logs, rms, servo_log
from .stated import StatedDrive
from .words import errors_table, print_drives, remarks_on

Array = NDArray[np.float64]

# rad (m) by which two runs of one command may differ in it.
SAME_COMMAND = 1e-6


def identify_servo_logs(
    model: Path,
    logs: Sequence[Path],
    validation_logs: Sequence[Path],
    out: Path,
    stated: StatedDrive | None,
    fit_share: float = 1.0,
    effects: Sequence[str] = (),
    identified_model: Path | None = None,
    map_path: Path | None = None,
    choice: Choice | None = None,
    joint_names: Sequence[str] | None = None,
) -> IdentifiedDrives:
    """Identify the drives of logs without torque, write DIR/estimate.json, print the summary.

    fit_share: of each log that is fitted; the rest of it judges, beside the validation logs.
    effects: that every joint may have beside viscous and Coulomb friction.
    identified_model: MJCF to write, with position servos. joint_names: those of the first log, where known.
    Raises InputError.
    """
    if not 0 < fit_share <= 1:
        raise InputError("testbench", "--fit-share", "above 0, and 1 at most", fit_share)
    for effect in effects:
        if effect not in EFFECTS:
            raise InputError("testbench", "--effect", "an effect of a drive", repr(effect), EFFECTS)
    paths = [*logs, *validation_logs]
    require_writable(out / DOCUMENT)
    if identified_model is not None:
        require_writable(identified_model, model, *paths)
    robot = load_robot(model, choice, joint_names)
    print_notes(robot)
    read = read_servo_logs(paths, robot, stated, map_path)
    fitted, judged = _divided(read[: len(logs)], fit_share)
    judged += [log.run for log in read[len(logs) :]]
    found = identify_drives(robot, [log.servo for log in read], fitted, tuple(effects))
    errors = [_errors("fit", found, fitted)]
    if judged:
        errors.append(_errors("validation", found, judged))
    remarks, differing = remarks_on(found), differences(found, judged or fitted)
    if identified_model is not None:
        write_corrected(found, identified_model)
    write_json(drives_document(found, errors, remarks, differing), out / DOCUMENT)
    print_drives(found, errors, remarks, differing)
    return found


def _divided(logs: Sequence[ServoLog], share: float) -> tuple[list[ServoRun], list[ServoRun]]:
    """The runs to fit, and those that judge them."""
    if share == 1:
        return [log.run for log in logs], []
    halves = [split(log.run, share) for log in logs]
    return [first for first, _ in halves], [rest for _, rest in halves]


def _errors(role: str, found: IdentifiedDrives, runs: Sequence[ServoRun]) -> Errors:
    given, identified = (position_rms(found.limbs, table, runs) for table in (found.given, found.identified))
    return Errors(role, given, identified)


def predict_position(
    directory: Path,
    log: Path,
    out: Path,
    stated: StatedDrive | None = None,
    map_path: Path | None = None,
    repeat: Path | None = None,
) -> Errors:
    """Simulate the corrected closed loop on LOG's command, write it to ``out`` and print its position error.

    ``out`` is a robot-log with LOG's time and command, and the simulated position, velocity and drive torque.
    stated: the drives of this run where they differ from those identified. repeat: another run of the same
    command, by which one sees how well the robot repeats itself. Raises InputError.
    """
    require_writable(out, log, directory / DOCUMENT)
    drives = read_drives(directory)
    read = _read_for(drives, log, stated, map_path)
    parts = limbs(drives.chain)
    given, identified = (simulated(parts, table, read.run) for table in (drives.given, drives.identified))
    errors = Errors("", *(rms(each.position - read.run.position) for each in (given, identified)))
    repeated = None
    if repeat is not None:
        other = _read_for(drives, repeat, stated, map_path).run
        if other.command.shape != read.run.command.shape or not np.allclose(
            other.command, read.run.command, atol=SAME_COMMAND
        ):
            raise InputError(repeat, "reference/position", f"the command of {log}", "another command")
        repeated = rms(other.position - read.run.position)
    recording = read.recording
    written = Recording(
        robot=recording.robot,
        joint_names=drives.joint_names,
        sample_rate=recording.sample_rate,
        source="prediction",
        time=recording.time,
        position=identified.position,
        torque=identified.torque,
        velocity=identified.velocity,
        reference_position=read.run.command,
        provenance={"estimate": directory.name, "log": log.name},
        is_slide=recording.is_slide,
    )
    out.parent.mkdir(parents=True, exist_ok=True)
    write_log(written, out)
    console().print(errors_table(drives.joint_names, [errors], repeated))
    samples, joints = identified.position.shape
    print(f"{out}: simulated position, velocity and torque of {joints} joints at {samples} instants of {log}")
    return errors


def _read_for(drives: ReadDrives, log: Path, stated: StatedDrive | None, map_path: Path | None) -> ServoLog:
    """A log whose gains are those stated, else its own, else those that were identified with."""
    recording = in_model_order(read_motion(log, drives.chain, drives.limits, map_path), drives.joint_names)
    check_joints(recording, drives.joint_names, log)
    require_plausible_motion(recording, drives.chain, drives.limits, log)
    if stated is None and recording.servo is None:
        stated = StatedDrive(kp=tuple(drives.kp.tolist()), kd=tuple(drives.kd.tolist()))
    return servo_log(log, recording, log.stem, drives, stated)
