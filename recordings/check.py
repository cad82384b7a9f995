"""The job behind ``check``: a model and logs in, what is to be known of them out."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console, Group
from rich.text import Text

from testbench.log import Recording
from testbench.model_reading.reading import Choice
from testbench.robot import Robot, load_robot, print_notes
from testbench.runs import opened_runs, run_names
from testbench.summary import WIDTH, finding_line

from .checks import Finding, Severity, run_checks


def check_logs(
    model: Path,
    logs: Sequence[Path],
    as_json: bool = False,
    map_path: Path | None = None,
    choice: Choice | None = None,
    joint_names: Sequence[str] | None = None,
) -> tuple[Finding, ...]:
    """Check the logs against the model and print what is found. Raises InputError for unreadable files.

    map_path: how recordings that are no robot-logs are read. choice: of the model; joint_names, of the first
    log, are the robot's where it names none.
    """
    robot = load_robot(model, choice, joint_names)
    runs, guessed = opened_runs(logs, robot, map_path)
    recordings = dict(zip(run_names(logs), runs, strict=True))
    found = run_checks(robot, recordings)
    if as_json:
        whole = {**document(robot, recordings, found), "notes": [*robot.notes, *guessed]}
        print(json.dumps(whole, indent=2, ensure_ascii=False))
        return found
    print_notes(robot)
    for line in guessed:
        print(line)
    console = Console()
    if not console.is_terminal:
        console.width = WIDTH
    console.print(in_lines(robot, recordings, found), soft_wrap=True)
    return found


def document(robot: Robot, recordings: Mapping[str, Recording], found: Sequence[Finding]) -> dict[str, Any]:
    """The findings and the figures of each run, for machines."""
    return {
        "robot": robot.name,
        "joint_names": list(robot.joint_names),
        "runs": [_figures(name, each) for name, each in recordings.items()],
        "sound": not any(each.severity is Severity.STOP for each in found),
        "findings": [asdict(each) for each in found],
    }


def _figures(name: str, recording: Recording) -> dict[str, Any]:
    return {
        "name": name,
        "seconds": float(recording.time[-1] - recording.time[0]),
        "samples": len(recording.time),
        "sample_rate": recording.sample_rate,
        "position_min": recording.position.min(axis=0).tolist(),
        "position_max": recording.position.max(axis=0).tolist(),
        "torque_rms": np.sqrt(np.mean(recording.torque**2, axis=0)).tolist(),
        "torque_max": np.abs(recording.torque).max(axis=0).tolist(),
    }


def in_lines(robot: Robot, recordings: Mapping[str, Recording], found: Sequence[Finding]) -> Group:
    """Lines of the report: the recordings, ranges of motion, torques, and the findings, most severe first."""
    seconds = sum(float(each.time[-1] - each.time[0]) for each in recordings.values())
    rates = sorted(each.sample_rate for each in recordings.values())
    at = " and ".join(dict.fromkeys(f"{rate:.4g} Hz" for rate in rates))
    count = f"{len(recordings)} run" + ("s" if len(recordings) > 1 else "")
    position = np.concatenate([each.position for each in recordings.values()])
    torque = np.concatenate([each.torque for each in recordings.values()])
    ways = ", ".join(
        f"{name} {low:.2f} to {high:.2f}"
        for name, low, high in zip(robot.joint_names, position.min(axis=0), position.max(axis=0), strict=True)
    )
    rms = np.sqrt(np.mean(torque**2, axis=0))
    torques = ", ".join(
        f"{name} {own:.3g}{_of_limit(own, limit)}"
        for name, own, limit in zip(robot.joint_names, rms, robot.limits.torque, strict=True)
    )
    lines = [
        Text(f"{robot.name}: {count}, {seconds:.3g} s at {at}, {robot.joints} joints", style="bold"),
        Text.assemble(("position", "dim"), f" rad (m): {ways}"),
        Text.assemble(("torque  ", "dim"), f" N·m (N), RMS: {torques}"),
        *(finding_line(each) for each in found),
    ]
    if not found:
        lines.append(Text("nothing stands out", style="green"))
    return Group(*lines)


def _of_limit(rms: float, limit: float) -> str:
    return f" ({rms / limit:.0%} of its limit)" if np.isfinite(limit) and limit > 0 else ""
