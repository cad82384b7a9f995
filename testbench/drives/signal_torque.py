"""Torque of drives whose current, duty or voltage was logged: k u, less k_e dq where a voltage makes it."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from identification.errors import InputError
from identification.lost_sign import likeliest_signs
from identification.parameters import PER_JOINT, VISCOUS

from ..drive import SIGNALS
from ..log import Recording
from ..robot import Robot

Array = NDArray[np.float64]

# Share of a joint's mean square torque of which the sign is clear, at least.
CLEAR = 0.8


def torque_of_signal(recording: Recording, path: Path, robot: Robot) -> tuple[Array, str] | None:
    """Torque (N, n) N·m by the stated drive, and a line on what fixes its scale and sign.

    None where the log states no constant of every joint. A signal without its sign, or nowhere below zero,
    has that of the model's torque. Both sides of a fit are low-passed alike, so the speed may be the plain
    difference of positions. Raises InputError for a signal whose sign the model does not determine.
    """
    drive = recording.drive
    if drive is None or drive.kind not in SIGNALS:
        return None
    signal, per_unit = getattr(recording, drive.kind), drive.torque_per_unit
    if signal is None or per_unit is None or not np.isfinite(per_unit).all():
        return None
    torque, law = signal * per_unit, f"the {drive.kind} times the drive's torque_per_unit"
    back_emf = drive.back_emf
    if drive.kind == "current" or (back_emf is not None and not np.isfinite(back_emf).all()):
        back_emf = None
    sign = ""
    if drive.kind in recording.unsigned or not np.any(signal < 0):
        torque, sign = _with_sign(np.abs(torque), recording, back_emf, path, robot)
    if back_emf is not None:
        torque = torque - back_emf * np.gradient(recording.position, axis=0) * recording.sample_rate
        law += ", less back_emf times the speed"
    elif drive.kind != "current":
        law += "; what the speed takes of it (back_emf, not stated) counts as viscous friction"
    scale = "; the scale of masses and friction is that constant's"
    if drive.spread is not None and np.isfinite(drive.spread).all():
        scale += f", known to {drive.spread.max():.0%}"
    return torque, f"{path}: no torque was measured: it is {law}{scale}{sign}"


def _with_sign(
    size: Array, recording: Recording, back_emf: Array | None, path: Path, robot: Robot
) -> tuple[Array, str]:
    """A torque of a size (N, n) N·m with the sign that the model's has, and a line on how clear it is."""
    parameters = robot.parameters.copy().reshape(-1, PER_JOINT)
    # What the voltage loses to the speed looks like viscous friction.
    parameters[: robot.joints, VISCOUS] += 0.0 if back_emf is None else back_emf
    found = likeliest_signs(robot.chain, parameters.ravel(), recording.position, recording.sample_rate, size)
    assert recording.drive is not None
    kind, least = recording.drive.kind, int(np.argmin(found.clear))
    of = f"{found.clear[least]:.0%} of the mean square torque of {robot.joint_names[least]}"
    if found.clear[least] < CLEAR:
        expected = f"a {kind} with its sign, or one whose sign the model's torque determines"
        raise InputError(path, f"joint/{kind}", expected, f"none below zero, and a clear sign for {of}")
    return found.expected * size, (
        f"; the {kind} has no sign: it is that of the model's torque, fitted to its size (clear for {of}, "
        "the least; what is not clear counts for little)"
    )
