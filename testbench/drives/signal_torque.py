"""Torque of drives whose current, duty or voltage was logged: k u, less k_e dq where a voltage makes it."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..drive import SIGNALS
from ..log import Recording

Array = NDArray[np.float64]


def torque_of_signal(recording: Recording, path: Path) -> tuple[Array, str] | None:
    """Torque (N, n) N·m by the stated drive, and a line on what fixes its scale.

    None where the log states no constant of every joint, or its signal has lost its sign. Both sides of a fit
    are low-passed alike, so the speed may be the plain difference of positions.
    """
    drive = recording.drive
    if drive is None or drive.kind not in SIGNALS or drive.kind in recording.unsigned:
        return None
    signal, per_unit = getattr(recording, drive.kind), drive.torque_per_unit
    if signal is None or per_unit is None or not np.isfinite(per_unit).all():
        return None
    torque, law = signal * per_unit, f"the {drive.kind} times the drive's torque_per_unit"
    if drive.kind != "current":
        if drive.back_emf is not None and np.isfinite(drive.back_emf).all():
            torque = torque - drive.back_emf * np.gradient(recording.position, axis=0) * recording.sample_rate
            law += ", less back_emf times the speed"
        else:
            law += "; what the speed takes of it (back_emf, not stated) counts as viscous friction"
    scale = "; the scale of masses and friction is that constant's"
    if drive.spread is not None and np.isfinite(drive.spread).all():
        scale += f", known to {drive.spread.max():.0%}"
    return torque, f"{path}: no torque was measured: it is {law}{scale}"
