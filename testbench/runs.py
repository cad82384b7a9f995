"""The logs that one job is given, in any format: each the robot's, with torque in it, and no run twice."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from identification.chain import Chain
from identification.errors import InputError
from recordings.door import Door, is_guessed, said
from recordings.joints import Joints, joints_of

from .degrees import in_radians
from .drive import SIGNALS
from .drives.signal_torque import torque_of_signal
from .log import Recording, check_joints, in_model_order
from .model_reading.reading import Choice
from .robot import Limits, Robot, load_robot


def read_runs(paths: Sequence[Path], robot: Robot, map_path: Path | None = None) -> list[Recording]:
    """The recordings of these logs, in their order; what was guessed of other formats is printed.

    As ``opened_runs``.
    """
    recordings, lines = opened_runs(paths, robot, map_path)
    for line in lines:
        print(line)
    return recordings


def opened_runs(
    paths: Sequence[Path], robot: Robot, map_path: Path | None = None
) -> tuple[list[Recording], list[str]]:
    """The recordings of these logs, in their order, and lines on what was guessed of other formats.

    map_path: how recordings that are no robot-logs are read; else a map beside them, or a guess. Joints in
    another order are sorted by name, and positions in degrees converted. Raises InputError for a log whose
    joints are not the robot's, and for a run that is given twice, be it under another name: no run may speak
    for itself as one that was left out.
    """
    door = Door(joints_of(robot.chain, robot.limits), map_path)
    opened = [door.log(path) for path in paths]
    lines = said(opened, robot.path)
    recordings = []
    for path, each in zip(paths, opened, strict=True):
        recording = in_model_order(each.recording, robot.joint_names)
        check_joints(recording, robot.joint_names, path)
        recording, note = _with_torque(in_radians(recording, robot), path, robot)
        recordings.append(recording)
        lines += note
    for later, path in enumerate(paths):
        for earlier in range(later):
            if _is_same(recordings[earlier], recordings[later]):
                raise InputError(path, "log", "each run once", f"the run of {paths[earlier]} again")
    return recordings, lines


@dataclass(frozen=True)
class FirstLook:
    """A log as it is before its robot is known. joint_names: None where it cannot be read.

    servo: whether it has no torque, and says that position servos drove it.
    """

    joint_names: tuple[str, ...] | None
    servo: bool


def first_look(
    path: Path, model: Path, choice: Choice | None = None, map_path: Path | None = None
) -> FirstLook:
    """The joints that a recording names, and whether it is one of position servos without torque.

    model, choice: of the robot, by whose joints the columns of a recording without a map are known.
    """
    joints = _joints_to_guess_by(path, model, choice, map_path)
    try:
        recording = Door(joints, map_path).log(path).recording
    except InputError:
        # Torque that is wrong does not keep its joints from being read.
        return FirstLook(_named(path, joints, map_path), False)
    return FirstLook(recording.joint_names, recording.servo is not None and not recording.has_torque)


def logged_joints(
    path: Path, model: Path, choice: Choice | None = None, map_path: Path | None = None
) -> tuple[str, ...] | None:
    """The joints that a recording names; None where it cannot be read, which its reader then says.

    model, choice: as of ``first_look``.
    """
    return _named(path, _joints_to_guess_by(path, model, choice, map_path), map_path)


def _named(path: Path, joints: Joints | None, map_path: Path | None) -> tuple[str, ...] | None:
    try:
        return Door(joints, map_path).log(path, with_torque=False).recording.joint_names
    except InputError:
        return None


def _joints_to_guess_by(
    path: Path, model: Path, choice: Choice | None, map_path: Path | None
) -> Joints | None:
    """The model's joints where columns are guessed; None where the log or a map names its joints itself."""
    try:
        if not is_guessed(path, map_path):
            return None
        robot = load_robot(model, choice)
    except InputError:
        return None
    return joints_of(robot.chain, robot.limits)


def read_motion(path: Path, chain: Chain, limits: Limits, map_path: Path | None = None) -> Recording:
    """The recording of a log whose torque is not looked at; a guess is printed. Raises InputError."""
    opened = Door(joints_of(chain, limits), map_path).log(path, with_torque=False)
    for line in said([opened], None):
        print(line)
    return opened.recording


def _with_torque(recording: Recording, path: Path, robot: Robot) -> tuple[Recording, list[str]]:
    """The recording with torque, of its drives' signal where none was measured, and a line that says so.

    Raises InputError, saying what is missing, where there is neither.
    """
    if recording.has_torque:
        return recording, []
    found = torque_of_signal(recording, path, robot)
    if found is not None:
        torque, line = found
        return replace(recording, torque=torque), [line]
    expected = (
        "measured torque, or a current, duty or voltage with its constant (torque_constant or the "
        "drive's torque_per_unit in a map)"
    )
    raise InputError(path, "joint/torque", expected, _instead(recording))


def _instead(recording: Recording) -> str:
    """What a log without torque has in its place, in words."""
    found = [
        f"{name}{' without its sign' if name in recording.unsigned else ''}"
        for name in SIGNALS
        if getattr(recording, name) is not None
    ]
    if recording.current is not None:
        found.append("no torque constant of every joint")
    if recording.reference_position is not None:
        found.append("reference positions")
    return "none, but " + ", ".join(found) if found else "none"


def run_names(paths: Sequence[Path]) -> list[str]:
    """File stems, or whole paths where stems repeat."""
    stems = [path.stem for path in paths]
    return [stem if stems.count(stem) == 1 else str(path) for stem, path in zip(stems, paths, strict=True)]


def by_path(error: InputError, paths: Sequence[Path]) -> InputError:
    """The error of a job on these logs, named by their paths where it names a run, or the runs."""
    files = dict(zip(run_names(paths), map(str, paths), strict=True))
    files |= dict.fromkeys(("log", "logs"), ", ".join(map(str, paths)))
    return error.located(files.get(error.source, error.source))


def _is_same(one: Recording, other: Recording) -> bool:
    return (
        np.array_equal(one.time, other.time)
        and np.array_equal(one.position, other.position)
        and np.array_equal(one.torque, other.torque)
    )
