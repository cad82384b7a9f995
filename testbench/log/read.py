"""Reading a robot-log: what only the file shows is checked here, and what it means is understood."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from identification.errors import InputError

from ..containment.child import contained
from ..drive import SIGNALS, is_signed, read_drive
from ..files import require_file
from ..hdf5 import CheckedFile, opened
from ..understood import in_seconds, spelled, without_gaps
from .recording import CHANNELS, POSITION_SERVO, REQUIRED, Controller, Recording, saying
from .rules import CONTROLLER_KINDS, FORMAT, VERSION, VERSION_OF_DRIVES, check_recording

Array = NDArray[np.float64]


def read_log(path: str | Path, with_truth: bool = False, with_torque: bool = True) -> Recording:
    """Read a robot-log and check every rule of the format; ``truth`` stays empty unless asked for.

    with_torque: False for what needs the motion alone; joint/torque is left alone then, be it there or not,
    and the recording's torque is zero. Raises InputError naming the file, the dataset or attribute, and the
    rule it breaks.
    """
    path = Path(path)
    require_file(path, "log", "an existing robot-log file")
    size = path.stat().st_size
    expected = "an HDF5 file that is not damaged"
    asked = with_truth, with_torque
    recording = contained("testbench.log.read:read_here", path, "log", expected, *asked, size=size)
    assert isinstance(recording, Recording)
    return recording


def read_here(name: str, with_truth: bool = False, with_torque: bool = True) -> Recording:
    """The same, read in this process, which damage to the file may crash."""
    path = Path(name)
    with opened(path) as file:
        recording = _mended(_Reader(file, path).recording(with_truth, with_torque))
    check_recording(recording, path)
    return recording


class _Reader(CheckedFile):
    """An open robot-log; checks what only the file shows: attributes, presence, types, units."""

    def __init__(self, file: h5py.File, path: Path):
        super().__init__(file, path)
        if self.text(file, "format") != FORMAT:
            raise InputError(path, "format", repr(FORMAT), repr(self.text(file, "format")))
        expected = f"the number {VERSION} or {VERSION_OF_DRIVES}"
        self.version = self.number(file, "format_version", expected)
        if self.version not in (VERSION, VERSION_OF_DRIVES):
            raise InputError(path, "format_version", expected, f"{self.version:g}")
        self.joint_names = self._joint_names()
        self.slides = self._slides()

    def recording(self, with_truth: bool, with_torque: bool) -> Recording:
        """Everything that the file's version of the format knows; other datasets are left alone."""
        has_drives = self.version == VERSION_OF_DRIVES
        required = ("position",) if has_drives and self._says_what_drives_did() else REQUIRED
        channels = {
            channel: self._values(name, hinge, slide)
            for name, channel, hinge, slide in CHANNELS
            if (with_torque or channel != "torque")
            and (has_drives or channel not in SIGNALS)
            and (channel in required or self.has(name))
        }
        if "torque" not in channels:
            channels["torque"] = np.full_like(channels["position"], np.nan if with_torque else 0.0)
        truth: dict[str, Array] = {}
        effects: list[dict[str, Any]] = []
        if with_truth and self.has("truth"):
            group = self.group("truth")
            effects = json.loads(self.text(group, "effects")) if "effects" in group.attrs else []
            own = {name: f"truth/{name}" for name in group}
            truth = {name: self.numbers(place) for name, place in own.items() if self.is_dataset(place)}
        rate, stated = self.number(self.file, "sample_rate"), spelled(self.units("time")[0])
        time, unit = in_seconds(self.numbers("time"), rate, stated)
        if unit == "s" and stated != "s":
            time = self._values("time", "s", "s")
        recording = Recording(
            robot=self.text(self.file, "robot"),
            joint_names=self.joint_names,
            sample_rate=rate,
            source=self.text(self.file, "source"),
            time=time,
            controller=self._controller() if self.has("controller") else None,
            truth=truth,
            truth_effects=effects,
            provenance=self._provenance(),
            is_slide=self.slides if any(self.slides) else (),
            unsigned=tuple(
                name
                for name in SIGNALS
                if name in channels and not is_signed(self, self.dataset(f"joint/{name}"))
            ),
            drive=read_drive(self) if has_drives else None,
            **channels,
        )
        return recording if unit == "s" else saying(recording, f"time stamps are in {unit}: read as seconds")

    def _says_what_drives_did(self) -> bool:
        """Whether something stands in the place of torque."""
        servo = self.has("controller") and self.text(self.group("controller"), "kind") == POSITION_SERVO
        return servo or self.has("drive") or any(self.has(f"joint/{name}") for name in SIGNALS)

    def _joint_names(self) -> tuple[str, ...]:
        given = self.attribute(self.file, "joint_names")
        names = np.atleast_1d(given)
        if names.ndim != 1 or not all(isinstance(name, (str, bytes)) for name in names.tolist()):
            raise InputError(self.path, "joint_names", "a list of strings", names.tolist())
        if not len(names):
            raise InputError(self.path, "joint_names", "a list of strings, one a joint", "an empty list")
        joints = self.dataset("joint/position").shape
        if np.ndim(given) == 0 and joints is not None and joints[1:] not in ((), (1,)):
            got = f"one string, {self.decoded(names[0], 'joint_names')!r}"
            raise InputError(self.path, "joint_names", f"a list of {joints[1]} strings, one a joint", got)
        return tuple(self.decoded(name, "joint_names") for name in names.tolist())

    def _slides(self) -> tuple[bool, ...]:
        """Which joints slide, from the units of their positions; one unit stands for all joints."""
        n = len(self.joint_names)
        units = tuple(spelled(unit) for unit in self.units("joint/position"))
        if len(units) not in (1, n) or not set(units) <= {"rad", "m"}:
            raise InputError(
                self.path, "joint/position", "unit 'rad', 'm', or one of them a joint", list(units)
            )
        return tuple(unit == "m" for unit in (units * n if len(units) == 1 else units))

    def _values(self, name: str, hinge: str, slide: str) -> Array:
        """A dataset as float64, its unit checked."""
        values, units = self.numbers(name), tuple(spelled(unit) for unit in self.units(name))
        expected = [hinge] if hinge == slide else [slide if sliding else hinge for sliding in self.slides]
        if units != tuple(expected) and (len(set(expected)) > 1 or units != (expected[0],)):
            shown = expected if len(set(expected)) > 1 else repr(expected[0])
            raise InputError(
                self.path, name, f"unit {shown}", list(units) if len(units) > 1 else repr(units[0])
            )
        return values

    def _controller(self) -> Controller:
        group = self.group("controller")
        kind = self.text(group, "kind")
        if kind not in CONTROLLER_KINDS:
            raise InputError(self.path, "controller kind", "a controller", repr(kind), CONTROLLER_KINDS)
        gains: dict[str, Array] = {}
        for name in ("kp", "kd"):
            if kind != "unknown" or self.has(f"controller/{name}"):
                # The format spells no unit of theirs.
                gains[name] = self.numbers(f"controller/{name}")
        needs_smoothing = kind == "pd_with_model_feedforward"
        smoothing = self.number(group, "coulomb_smoothing") if needs_smoothing else None
        delay = self.number(group, "delay") if "delay" in group.attrs else None
        # What nothing is known of, and a servo of its own, may have no rate either; it is not used.
        if kind in ("unknown", POSITION_SERVO) and "rate" not in group.attrs:
            rate = self.number(self.file, "sample_rate")
        else:
            rate = self.number(group, "rate")
        return Controller(kind, rate, coulomb_smoothing=smoothing, delay=delay, **gains)

    def _provenance(self) -> dict[str, Any]:
        """The log's record of its origin, where that is a JSON object; the format asks for none."""
        if "provenance" not in self.file.attrs:
            return {}
        try:
            provenance = json.loads(self.text(self.file, "provenance"))
        # RecursionError: brackets without end.
        except (InputError, ValueError, RecursionError):
            return {}
        return provenance if isinstance(provenance, dict) else {}


def _mended(recording: Recording) -> Recording:
    """The recording with a few NaN in a row interpolated, and without channels that nobody filled."""
    changed: dict[str, Any] = {}
    for name, channel, _, _ in CHANNELS:
        values = getattr(recording, channel)
        if values is None:
            continue
        if channel not in REQUIRED and values.size and np.isnan(values).all():
            changed[channel] = None
            recording = saying(recording, f"{name} is NaN throughout: left out")
            continue
        filled, count = without_gaps(recording.time, values)
        if count:
            changed[channel] = filled
            recording = saying(recording, f"{name} has NaN in {count} samples: interpolated")
    return replace(recording, **changed)
