"""The jobs of robots without measured torque: identify their drives, and predict their position."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

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
from ..robot import Robot, load_robot, print_notes
from ..runs import read_motion
from ..terminal import console
from .corrected import write_corrected
from .differences import Difference, differences
from .document import DOCUMENT, Errors, ReadDrives, drives_document, read_drives
from .identified import IdentifiedDrives, Simulation, identify_drives, position_rms, simulated, split
from .reading import ServoLog, read_servo_logs, rms, servo_log
from .stated import StatedDrive
from .words import errors_table, print_drives, remarks_on

Array = NDArray[np.float64]

# rad (m) by which two runs of one command may differ in it.
SAME_COMMAND = 1e-6


@dataclass(frozen=True)
class DriveIdentification:
    """Identified drives, and what judges them.

    errors: of the fitted runs and then, where there are such, of runs that were not fitted. remarks:
    sentences on what the runs leave open. differences: from the model and the stated drives.
    """

    found: IdentifiedDrives
    errors: tuple[Errors, ...]
    remarks: tuple[str, ...]
    differences: tuple[Difference, ...]


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
) -> DriveIdentification:
    """Identify the drives of logs without torque, write DIR/estimate.json, print the summary.

    fit_share, effects: as of ``identify_servo_runs``. identified_model: MJCF to write, with position servos.
    joint_names: those of the first log, where known. Raises InputError.
    """
    _require_options(fit_share, effects)
    paths = [*logs, *validation_logs]
    require_writable(out / DOCUMENT)
    if identified_model is not None:
        require_writable(identified_model, model, *paths)
    robot = load_robot(model, choice, joint_names)
    print_notes(robot)
    read = read_servo_logs(paths, robot, stated, map_path)
    result = identify_servo_runs(robot, read[: len(logs)], read[len(logs) :], fit_share, effects)
    if identified_model is not None:
        write_corrected(result.found, identified_model)
    write_estimate(result, out)
    print_drives(result.found, result.errors, result.remarks, result.differences)
    return result


def identify_servo_runs(
    robot: Robot,
    fitted: Sequence[ServoLog],
    judging: Sequence[ServoLog],
    fit_share: float = 1.0,
    effects: Sequence[str] = (),
) -> DriveIdentification:
    """The drives by the fitted logs, judged by the others.

    fit_share: of each fitted log that is fitted; the rest of it judges, beside the judging ones.
    effects: that every joint may have beside viscous and Coulomb friction. Raises InputError.
    """
    _require_options(fit_share, effects)
    runs, judged = _divided(fitted, fit_share)
    judged += [log.run for log in judging]
    found = identify_drives(robot, [log.servo for log in (*fitted, *judging)], runs, tuple(effects))
    errors = [_errors("fit", found, runs)]
    if judged:
        errors.append(_errors("validation", found, judged))
    return DriveIdentification(found, tuple(errors), remarks_on(found), differences(found, judged or runs))


def write_estimate(result: DriveIdentification, out: Path) -> None:
    """Write DIR/estimate.json."""
    document = drives_document(result.found, result.errors, result.remarks, result.differences)
    write_json(document, out / DOCUMENT)


def _require_options(fit_share: float, effects: Sequence[str]) -> None:
    """Raise InputError for a share that is none, and effects that no drive has."""
    if not 0 < fit_share <= 1:
        raise InputError("testbench", "--fit-share", "above 0, and 1 at most", fit_share)
    for effect in effects:
        if effect not in EFFECTS:
            raise InputError("testbench", "--effect", "an effect of a drive", repr(effect), EFFECTS)


def _divided(logs: Sequence[ServoLog], share: float) -> tuple[list[ServoRun], list[ServoRun]]:
    """The runs to fit, and those that judge them."""
    if share == 1:
        return [log.run for log in logs], []
    halves = [split(log.run, share) for log in logs]
    return [first for first, _ in halves], [rest for _, rest in halves]


def _errors(role: str, found: IdentifiedDrives, runs: Sequence[ServoRun]) -> Errors:
    given, identified = (position_rms(found.limbs, table, runs) for table in (found.given, found.identified))
    return Errors(role, given, identified)


@dataclass(frozen=True)
class PredictedPosition:
    """A run simulated in closed loop on its command: by the model as given, and as identified.

    measured: the run on the even grid that both are simulated on.
    """

    measured: ServoRun
    recording: Recording
    given: Simulation
    identified: Simulation

    @property
    def errors(self) -> Errors:
        """RMS (n,) rad (m) of simulated less measured position."""
        return Errors(
            "", *(rms(each.position - self.measured.position) for each in (self.given, self.identified))
        )


def predicted(drives: ReadDrives, log: ServoLog) -> PredictedPosition:
    """A log's command followed by the plants as given and as identified."""
    parts = limbs(drives.chain)
    both = (simulated(parts, table, log.run) for table in (drives.given, drives.identified))
    return PredictedPosition(log.run, log.recording, *both)


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
    result = predicted(drives, _read_for(drives, log, stated, map_path))
    repeated = None
    if repeat is not None:
        other, run = _read_for(drives, repeat, stated, map_path).run, result.measured
        if other.command.shape != run.command.shape or not np.allclose(
            other.command, run.command, atol=SAME_COMMAND
        ):
            raise InputError(repeat, "reference/position", f"the command of {log}", "another command")
        repeated = rms(other.position - run.position)
    out.parent.mkdir(parents=True, exist_ok=True)
    write_log(as_recording(result, {"estimate": directory.name, "log": log.name}), out)
    console().print(errors_table(drives.joint_names, [result.errors], repeated))
    samples, joints = result.identified.position.shape
    print(f"{out}: simulated position, velocity and torque of {joints} joints at {samples} instants of {log}")
    return result.errors


def as_recording(result: PredictedPosition, provenance: dict[str, Any]) -> Recording:
    """The prediction as a log: the run's time and command, and what the identified loop makes of them."""
    recording, found = result.recording, result.identified
    return Recording(
        robot=recording.robot,
        joint_names=recording.joint_names,
        sample_rate=recording.sample_rate,
        source="prediction",
        time=recording.time,
        position=found.position,
        torque=found.torque,
        velocity=found.velocity,
        reference_position=result.measured.command,
        provenance=provenance,
        is_slide=recording.is_slide,
    )


def _read_for(drives: ReadDrives, log: Path, stated: StatedDrive | None, map_path: Path | None) -> ServoLog:
    """A log whose gains are those stated, else its own, else those that were identified with."""
    recording = in_model_order(read_motion(log, drives.chain, drives.limits, map_path), drives.joint_names)
    return log_for(drives, recording, log, log.stem, stated)


def log_for(
    drives: ReadDrives, recording: Recording, path: Path, name: str, stated: StatedDrive | None
) -> ServoLog:
    """A recording with the gains that are stated, else its own, else those that were identified with.

    path: its file, which errors name. Raises InputError.
    """
    check_joints(recording, drives.joint_names, path)
    require_plausible_motion(recording, drives.chain, drives.limits, path)
    if stated is None and recording.servo is None:
        stated = StatedDrive(kp=tuple(drives.kp.tolist()), kd=tuple(drives.kd.tolist()))
    return servo_log(path, recording, name, drives, stated)
