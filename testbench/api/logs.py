"""A robot and its logs: a model's file, and recordings in any format."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from ..blas import single_blas_thread
from .notes import note

if TYPE_CHECKING:
    from recordings.checks.finding import Finding

    from ..log import Recording
    from ..robot import Robot


@single_blas_thread()
def load_robot(
    model: str | Path,
    joints: Sequence[str] | None = None,
    *,
    fix_base: bool = False,
    packages: Mapping[str, str | Path] | None = None,
    log: str | Path | None = None,
) -> Robot:
    """The robot of an MJCF or a URDF: names, limits, kinematics and standard parameters.

    Args:
        model: the file.
        joints: those that move; all others are held still, and their mass counts. When None, those of
            ``log``; when there is none either, all but a gripper's.
        fix_base: hold a floating base.
        packages: folders of ROS packages by name.
        log: a recording whose joints move.

    Raises:
        InputError: the file is no robot, or has forces that identification does not know.
    """
    from ..model_reading.reading import Choice
    from ..robot import load_robot as load
    from ..runs import logged_joints

    folders = {name: Path(folder) for name, folder in (packages or {}).items()}
    choice = Choice(None if joints is None else tuple(joints), fix_base, folders)
    robot = load(model, choice, None if log is None else logged_joints(Path(log), Path(model), choice))
    note(f"{robot.path.name}: {each}" for each in robot.notes)
    return robot


@single_blas_thread()
def read_logs(
    paths: str | Path | Sequence[str | Path],
    robot: Robot,
    mapping: str | Path | None = None,
    *,
    torque: bool = True,
) -> dict[str, Recording]:
    """Runs by name, from robot-logs, CSV, Parquet, npz, JSON or ROS bags, in SI units.

    Args:
        paths: a file a run.
        robot: whose runs these are.
        mapping: YAML that says which column is which signal. When None, a map beside the file, or a guess,
            which is logged.
        torque: False for a robot that measures none, whose drives are stated: torque is not read.

    Raises:
        InputError: a file cannot be read, its joints are not the robot's, or a run is given twice.
    """
    from ..drives.reading import opened_motions
    from ..runs import opened_runs, run_names

    files = [Path(paths)] if isinstance(paths, str | Path) else [Path(each) for each in paths]
    opened = opened_runs if torque else opened_motions
    recordings, lines = opened(files, robot, None if mapping is None else Path(mapping))
    note(lines)
    return dict(zip(run_names(files), recordings, strict=True))


@single_blas_thread()
def check(robot: Robot, runs: Mapping[str, Recording]) -> tuple[Finding, ...]:
    """What is wrong with the runs, the most severe first: units, order, signs, zeros, torque, excitation."""
    from recordings.checks import run_checks

    return run_checks(robot, runs)
