"""Writing a robot-log: the whole file or none, the same bytes for the same recording."""

import json
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path

import h5py
import numpy as np
from numpy.typing import NDArray

from identification.errors import InputError

from ..drive import drive_units
from ..files import replacing
from ..hdf5 import write_hdf5
from .recording import CHANNELS, Recording
from .rules import FORMAT, VERSION, VERSION_OF_DRIVES, check_recording

Array = NDArray[np.float64]

TRUTH_UNITS = {
    "position": ("rad", "m"),
    "velocity": ("rad/s", "m/s"),
    "acceleration": ("rad/s^2", "m/s^2"),
    "torque": ("N·m", "N"),
    "friction_torque": ("N·m", "N"),
    "link_position": ("rad", "m"),
    "effect_torque": ("N·m", "N"),
}


def write_log(
    recording: Recording,
    path: str | Path,
    beside: Mapping[str, Array] | None = None,
    band: Array | None = None,
) -> None:
    """Write a robot-log so that ``path`` holds either the whole log or what it held before.

    The provenance is stored as JSON with ``created``, the time of writing (UTC) unless the
    recording brings its own; everything else depends on the recording alone, byte for byte.
    beside: more torques (N, n) by the names of their datasets, which are no part of the format. band: (n,)
    Hz, of the low-pass that all torques have passed, their attribute; None for none.
    Raises InputError for a recording that ``read_log`` would refuse, or a folder that does not exist.
    """
    path = Path(path)
    check_recording(recording, path)
    if not path.parent.is_dir():
        raise InputError(path, "folder", "an existing folder", path.parent)

    def fill(file: h5py.File) -> None:
        _write(file, recording)
        for name, torque in (beside or {}).items():
            _put(file, name, torque, file["joint/torque"].attrs["unit"])
        for name in () if band is None else ("joint/torque", *(beside or {})):
            file[name].attrs["band"] = band

    with replacing(path) as part:
        write_hdf5(part, fill)


def _write(file: h5py.File, recording: Recording) -> None:
    n = len(recording.joint_names)
    slides = recording.is_slide or (False,) * n
    created = {"created": datetime.now(UTC).isoformat(timespec="seconds")}
    file.attrs["format"] = FORMAT
    file.attrs["format_version"] = VERSION_OF_DRIVES if recording.has_drive else VERSION
    file.attrs["robot"], file.attrs["source"] = recording.robot, recording.source
    file.attrs["joint_names"] = list(recording.joint_names)
    file.attrs["sample_rate"] = float(recording.sample_rate)
    file.attrs["provenance"] = json.dumps(created | recording.provenance, sort_keys=True, ensure_ascii=False)
    _put(file, "time", recording.time, "s")
    for name, channel, hinge, slide in CHANNELS:
        values = getattr(recording, channel)
        if values is not None and (channel != "torque" or recording.has_torque):
            _put(file, name, values, _unit(hinge, slide, slides))
            if channel in recording.unsigned:
                file[name].attrs["signed"] = False
    if recording.drive is not None:
        group = file.create_group("drive")
        group.attrs["kind"] = recording.drive.kind
        for name, values in recording.drive.figures().items():
            _put(group, name, values, _unit(*drive_units(recording.drive, name), slides))
    if recording.controller is not None:
        controller = recording.controller
        group = file.create_group("controller")
        group.attrs["kind"], group.attrs["rate"] = controller.kind, float(controller.rate)
        for attribute in ("coulomb_smoothing", "delay"):
            if getattr(controller, attribute) is not None:
                group.attrs[attribute] = float(getattr(controller, attribute))
        for name, hinge, slide in (("kp", "N·m/rad", "N/m"), ("kd", "N·m·s/rad", "N·s/m")):
            if getattr(controller, name) is not None:
                _put(group, name, getattr(controller, name), _unit(hinge, slide, slides))
    for name, values in sorted(recording.truth.items()):
        hinge, slide = TRUTH_UNITS.get(name, ("SI", "SI"))
        _put(file, f"truth/{name}", values, _unit(hinge, slide, slides))
    if recording.truth_effects:
        effects = json.dumps(recording.truth_effects, sort_keys=True, ensure_ascii=False)
        file.require_group("truth").attrs["effects"] = effects


def _put(group: h5py.Group, name: str, values: Array, unit: str | list[str]) -> None:
    dataset = group.create_dataset(name, data=np.asarray(values, dtype=np.float64), track_times=False)
    dataset.attrs["unit"] = unit


def _unit(hinge: str, slide: str, slides: Sequence[bool]) -> str | list[str]:
    """The unit of a channel: one for all joints, or a list when hinge and slide joints differ."""
    units = [slide if sliding else hinge for sliding in slides]
    return units[0] if len(set(units)) == 1 else units
