"""What a drive did in a log without measured torque, and what is known of the drive."""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from identification.errors import InputError

from .hdf5 import CheckedFile, single

Array = NDArray[np.float64]

DRIVE_KINDS = ("torque", "current", "duty", "voltage", "position_servo")
# Kinds whose signal is logged: the channel is named like the kind.
SIGNALS = ("current", "duty", "voltage")
# Units by kind of the drive, on a hinge and on a slide joint.
PER_UNIT = {"current": ("N·m/A", "N/A"), "duty": ("N·m", "N"), "voltage": ("N·m/V", "N/V")}
UNITS = {"back_emf": ("N·m·s/rad", "N·s/m"), "spread": ("-", "-"), "limit": ("N·m", "N")}


@dataclass(frozen=True)
class Drive:
    """What is known of the drives; arrays (n,), NaN for a joint whose figure is not known.

    kind: torque, current, duty, voltage or position_servo. torque_per_unit: N·m at the joint for 1 A, full
    duty or 1 V. back_emf: N·m·s/rad. spread: relative standard deviation of torque_per_unit, or of a servo's
    gains. limit: N·m. Each but the kind may be None.
    """

    kind: str
    torque_per_unit: Array | None = None
    back_emf: Array | None = None
    spread: Array | None = None
    limit: Array | None = None

    def figures(self) -> dict[str, Array]:
        """The arrays that are given, by name."""
        given = {field.name: getattr(self, field.name) for field in fields(self) if field.name != "kind"}
        return {name: values for name, values in given.items() if values is not None}


def drive_units(drive: Drive, name: str) -> tuple[str, str]:
    """Unit of a drive's figure on a hinge and on a slide joint."""
    return PER_UNIT.get(drive.kind, ("-", "-")) if name == "torque_per_unit" else UNITS[name]


def read_drive(checked: CheckedFile) -> Drive | None:
    """The drive of an open robot-log, or None. Raises InputError."""
    if not checked.has("drive"):
        return None
    group = checked.group("drive")
    kind = checked.text(group, "kind")
    names = [field.name for field in fields(Drive) if field.name != "kind"]
    figures: dict[str, Any] = {name: checked.numbers(f"drive/{name}") for name in names if name in group}
    return Drive(kind, **figures)


def is_signed(checked: CheckedFile, dataset: h5py.Dataset) -> bool:
    """Whether a drive's signal has its sign: attribute ``signed``, true where there is none."""
    return "signed" not in dataset.attrs or bool(single(checked.attribute(dataset, "signed")))


def check_drive(drive: Drive, joint_names: Sequence[str], source: object) -> None:
    """Raise InputError, naming ``source``, for a kind or figures that no drive has."""
    if drive.kind not in DRIVE_KINDS:
        raise InputError(source, "drive kind", "a kind of drive", repr(drive.kind), DRIVE_KINDS)
    for name, values in drive.figures().items():
        if np.shape(values) != (len(joint_names),):
            expected = f"shape ({len(joint_names)},), one a joint"
            raise InputError(source, f"drive/{name}", expected, np.shape(values))
        # A torque constant may be negative where the motor turns the other way.
        impossible = np.isinf(values) if name == "torque_per_unit" else np.isinf(values) | (values < 0)
        if np.any(impossible):
            joint = int(np.argmax(impossible))
            expected = "finite values, or NaN where not known"
            raise InputError(source, f"drive/{name}", expected, f"{values[joint]} at {joint_names[joint]}")
