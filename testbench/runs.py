"""The logs that one job is given: each the robot's, with torque in it, and no run twice."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from identification.errors import InputError

from .degrees import in_radians
from .log import Recording, check_joints, in_model_order, read_log
from .robot import Robot


def read_runs(paths: Sequence[Path], robot: Robot) -> list[Recording]:
    """The recordings of these logs, in their order.

    Joints in another order are sorted by name, and positions in degrees converted. Raises InputError for a
    log whose joints are not the robot's, and for a run that is given twice, be it under another name: no run
    may speak for itself as one that was left out.
    """
    recordings = []
    for path in paths:
        recording = in_model_order(read_log(path), robot.joint_names)
        check_joints(recording, robot.joint_names, path)
        recordings.append(in_radians(recording, robot))
    for later, path in enumerate(paths):
        for earlier in range(later):
            if _is_same(recordings[earlier], recordings[later]):
                raise InputError(path, "log", "each run once", f"the run of {paths[earlier]} again")
    return recordings


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
