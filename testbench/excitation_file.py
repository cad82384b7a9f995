"""excitation.json: a designed motion, what it was designed for, and what it leaves to each limit."""

import math
from dataclasses import asdict
from pathlib import Path
from typing import Any

from identification.errors import InputError
from identification.excitation.excitation import Excitation
from identification.excitation.trajectories import trajectory_from_dict
from identification.excitation.trajectory import Trajectory

from .containment.json_text import read_bounded_json
from .files import require_file, write_json

FORMAT, VERSION = "excitation", 1

UNITS = {
    "position": "rad (m for a slide joint)",
    "velocity": "rad/s (m/s)",
    "acceleration": "rad/s^2 (m/s^2)",
    "torque": "N·m (N)",
    "clearance": "m",
    "frequency": "Hz",
    "criteria": "nats; information a sample, rows of the regressor over the joints' torque limits",
}


def excitation_document(excitation: Excitation) -> dict[str, Any]:
    """The excitation as JSON-able values, without its wall time; null for the margin of an absent limit."""
    values = excitation.values
    margins = asdict(excitation.margins)
    peaks = {key: _plain(value) for key, value in margins.pop("peaks").items()}
    margins = {key: _plain(value) for key, value in margins.items()}
    return {
        "format": FORMAT,
        "format_version": VERSION,
        "joint_names": excitation.joint_names,
        "trajectory": excitation.trajectory.to_dict(),
        "criterion": excitation.criterion,
        "criteria": asdict(values) | {"slack": values.slack},
        "margins": margins,
        "peaks": peaks,
        "limits_kept": excitation.margins.kept,
        "options": asdict(excitation.options),
        "evaluations": excitation.evaluations,
        "start_values": excitation.start_values,
        "units": UNITS,
    }


def write_excitation(excitation: Excitation, path: str | Path) -> None:
    """Write excitation.json; the file is complete or not there."""
    write_json(excitation_document(excitation), path)


def read_trajectory(path: str | Path) -> tuple[tuple[str, ...], Trajectory]:
    """Joint names and the motion of an excitation.json; a hand-written one needs nothing more.

    Raises InputError that names the file, the field and what is wrong with it.
    """
    path = Path(path)
    require_file(path, "trajectory", "an existing excitation.json")
    document = read_bounded_json(path, "trajectory")
    if not isinstance(document, dict) or "trajectory" not in document:
        raise InputError(path, "trajectory", "an object with joint_names and trajectory", "none")
    version = (document.get("format", FORMAT), document.get("format_version", VERSION))
    if version != (FORMAT, VERSION):
        raise InputError(
            path, "format", f"{FORMAT}, version {VERSION}", f"{version[0]}, version {version[1]}"
        )
    names = document.get("joint_names")
    if not isinstance(names, list) or not names or not all(isinstance(name, str) for name in names):
        raise InputError(path, "joint_names", "a list of joint names", repr(names)[:60])
    try:
        trajectory = trajectory_from_dict(document["trajectory"])
    except InputError as error:
        raise error.located(path) from None
    if trajectory.joints != len(names):
        raise InputError(path, "trajectory", f"{len(names)} joints, as in joint_names", trajectory.joints)
    return tuple(names), trajectory


def _plain(value: Any) -> Any:
    """Numbers and lists of numbers, null for what is infinite."""
    if value is None or isinstance(value, float | int):
        return value if value is None or math.isfinite(value) else None
    return [_plain(float(item)) for item in value]
