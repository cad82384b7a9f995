"""The robot-log format, version 1: one recorded run in one HDF5 file."""

import json
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from identification.errors import InputError

from .files import replacing, require_file
from .hdf5 import CheckedFile, decoded, single

Array = NDArray[np.float64]

FORMAT, VERSION = "robot-log", 1
CONTROLLER_KINDS = ("pd", "pd_with_model_feedforward", "unknown")
# Median sample interval against sample_rate: clocks of real robots jitter, but not on the whole.
RATE_TOLERANCE = 0.01

# Dataset, Recording field, unit on a hinge, unit on a slide joint; all (N, n).
CHANNELS = (
    ("joint/position", "position", "rad", "m"),
    ("joint/torque", "torque", "N·m", "N"),
    ("joint/velocity", "velocity", "rad/s", "m/s"),
    ("joint/torque_command", "torque_command", "N·m", "N"),
    ("joint/temperature", "temperature", "degC", "degC"),
    ("reference/position", "reference_position", "rad", "m"),
    ("reference/velocity", "reference_velocity", "rad/s", "m/s"),
    ("reference/acceleration", "reference_acceleration", "rad/s^2", "m/s^2"),
)
REQUIRED = ("position", "torque")
TRUTH_UNITS = {
    "position": ("rad", "m"),
    "velocity": ("rad/s", "m/s"),
    "acceleration": ("rad/s^2", "m/s^2"),
    "torque": ("N·m", "N"),
    "friction_torque": ("N·m", "N"),
    "link_position": ("rad", "m"),
    "effect_torque": ("N·m", "N"),
}


@dataclass(frozen=True)
class Controller:
    """What drove the robot. kind: pd, pd_with_model_feedforward or unknown. rate: Hz.

    kp, kd: (n,) N·m/rad and N·m·s/rad, or None. coulomb_smoothing: rad/s, of the feedforward, or None.
    """

    kind: str
    rate: float
    kp: Array | None = None
    kd: Array | None = None
    coulomb_smoothing: float | None = None


@dataclass(frozen=True)
class Recording:
    """One run as a robot-log holds it. N samples, n joints; SI units at the joint.

    time: (N,) s. position: (N, n) rad (m). torque: (N, n) N·m (N).
    velocity, torque_command, temperature: (N, n) or None; rad/s, N·m, degC.
    reference_position, reference_velocity, reference_acceleration: (N, n) or None.
    controller: or None. truth: what only a simulation knows, never read by identification.
    truth_effects: the unmodelled effects in the simulated robot; JSON-able, part of the truth.
    source: what made the log. provenance: scenario, seed, versions; JSON-able.
    is_slide: n flags, which joints slide; empty: every joint is a hinge.
    """

    robot: str
    joint_names: tuple[str, ...]
    sample_rate: float
    source: str
    time: Array
    position: Array
    torque: Array
    velocity: Array | None = None
    torque_command: Array | None = None
    temperature: Array | None = None
    reference_position: Array | None = None
    reference_velocity: Array | None = None
    reference_acceleration: Array | None = None
    controller: Controller | None = None
    truth: dict[str, Array] = field(default_factory=dict)
    truth_effects: list[dict[str, Any]] = field(default_factory=list)
    provenance: dict[str, Any] = field(default_factory=dict)
    is_slide: tuple[bool, ...] = ()


def with_channels(recording: Recording, time: Array, change: Callable[[str, Array], Array]) -> Recording:
    """The recording at other instants, time (M,) s, with every channel it has changed to fit them.

    change: of a channel's field and its values (N, n), those at the instants, (M, n).
    """
    values = {field: getattr(recording, field) for _, field, _, _ in CHANNELS}
    changed: dict[str, Any] = {field: change(field, own) for field, own in values.items() if own is not None}
    return replace(recording, time=time, **changed)


def check_joints(recording: Recording, joint_names: Sequence[str], source: object = "log") -> None:
    """Raise InputError unless the recording's joints are the model's, in the model's order."""
    if tuple(recording.joint_names) != tuple(joint_names):
        expected = f"the model's joints {list(joint_names)}"
        raise InputError(source, "joint_names", expected, list(recording.joint_names))


def logged_joints(path: str | Path) -> tuple[str, ...] | None:
    """The joints that a robot-log names, None for another file; what is wrong with it ``read_log`` says."""
    try:
        with h5py.File(path, "r") as file:
            return _Reader(file, Path(path)).joint_names
    except (OSError, InputError):
        return None


def write_log(recording: Recording, path: str | Path) -> None:
    """Write a robot-log so that ``path`` holds either the whole log or what it held before.

    The provenance is stored as JSON with ``created``, the time of writing (UTC) unless the
    recording brings its own; everything else depends on the recording alone, byte for byte.
    Raises InputError for a recording that ``read_log`` would refuse, or a folder that does not exist.
    """
    path = Path(path)
    check_recording(recording, path)
    if not path.parent.is_dir():
        raise InputError(path, "folder", "an existing folder", path.parent)
    with replacing(path) as part:
        with h5py.File(part, "w") as file:
            _write(file, recording)
        with part.open("rb") as written:
            os.fsync(written.fileno())


def _write(file: h5py.File, recording: Recording) -> None:
    n = len(recording.joint_names)
    slides = recording.is_slide or (False,) * n
    created = {"created": datetime.now(UTC).isoformat(timespec="seconds")}
    file.attrs["format"], file.attrs["format_version"] = FORMAT, VERSION
    file.attrs["robot"], file.attrs["source"] = recording.robot, recording.source
    file.attrs["joint_names"] = list(recording.joint_names)
    file.attrs["sample_rate"] = float(recording.sample_rate)
    file.attrs["provenance"] = json.dumps(created | recording.provenance, sort_keys=True, ensure_ascii=False)
    _put(file, "time", recording.time, "s")
    for name, channel, hinge, slide in CHANNELS:
        values = getattr(recording, channel)
        if values is not None:
            _put(file, name, values, _unit(hinge, slide, slides))
    if recording.controller is not None:
        controller = recording.controller
        group = file.create_group("controller")
        group.attrs["kind"], group.attrs["rate"] = controller.kind, float(controller.rate)
        if controller.coulomb_smoothing is not None:
            group.attrs["coulomb_smoothing"] = float(controller.coulomb_smoothing)
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


def read_log(path: str | Path, with_truth: bool = False, with_torque: bool = True) -> Recording:
    """Read a robot-log and check every rule of the format; ``truth`` stays empty unless asked for.

    with_torque: False for what needs the motion alone; joint/torque is left alone then, be it there or not,
    and the recording's torque is zero. Raises InputError naming the file, the dataset or attribute, and the
    rule it breaks.
    """
    path = Path(path)
    require_file(path, "log", "an existing robot-log file")
    try:
        file = h5py.File(path, "r")
    except OSError:
        raise InputError(path, "log", "an HDF5 file", "something else, or a damaged file") from None
    with file:
        recording = _Reader(file, path).recording(with_truth, with_torque)
    check_recording(recording, path)
    return recording


class _Reader(CheckedFile):
    """An open robot-log; checks what only the file shows: attributes, presence, types, units."""

    def __init__(self, file: h5py.File, path: Path):
        super().__init__(file, path)
        if self.text(file, "format") != FORMAT:
            raise InputError(path, "format", repr(FORMAT), repr(self.text(file, "format")))
        version = self.number(file, "format_version", f"the number {VERSION}")
        if version != VERSION:
            raise InputError(path, "format_version", f"the number {VERSION}", f"{version:g}")
        self.joint_names = self._joint_names()
        self.slides = self._slides()

    def recording(self, with_truth: bool, with_torque: bool) -> Recording:
        """Everything that version 1 of the format knows; other datasets are left alone."""
        channels = {
            channel: self._values(name, hinge, slide)
            for name, channel, hinge, slide in CHANNELS
            if (with_torque or channel != "torque") and (channel in REQUIRED or name in self.file)
        }
        if not with_torque:
            channels["torque"] = np.zeros_like(channels["position"])
        truth: dict[str, Array] = {}
        effects: list[dict[str, Any]] = []
        if with_truth and "truth" in self.file:
            group = self.file["truth"]
            effects = json.loads(group.attrs.get("effects", "[]"))
            truth = {
                name: self.numbers(f"truth/{name}") for name in group if isinstance(group[name], h5py.Dataset)
            }
        return Recording(
            robot=self.text(self.file, "robot"),
            joint_names=self.joint_names,
            sample_rate=self.number(self.file, "sample_rate"),
            source=self.text(self.file, "source"),
            time=self._values("time", "s", "s"),
            controller=self._controller() if "controller" in self.file else None,
            truth=truth,
            truth_effects=effects,
            provenance=self._provenance(),
            is_slide=self.slides if any(self.slides) else (),
            **channels,
        )

    def _joint_names(self) -> tuple[str, ...]:
        given = self.attribute(self.file, "joint_names")
        names = np.atleast_1d(given)
        if names.ndim != 1 or not all(isinstance(name, (str, bytes)) for name in names.tolist()):
            raise InputError(self.path, "joint_names", "a list of strings", names.tolist())
        joints = self.dataset("joint/position").shape
        if np.ndim(given) == 0 and joints is not None and joints[1:] not in ((), (1,)):
            got = f"one string, {decoded(given)!r}"
            raise InputError(self.path, "joint_names", f"a list of {joints[1]} strings, one a joint", got)
        return tuple(decoded(name) for name in names.tolist())

    def _slides(self) -> tuple[bool, ...]:
        """Which joints slide, from the units of their positions; one unit stands for all joints."""
        n = len(self.joint_names)
        units = self.units("joint/position")
        if len(units) not in (1, n) or not set(units) <= {"rad", "m"}:
            raise InputError(
                self.path, "joint/position", "unit 'rad', 'm', or one of them a joint", list(units)
            )
        return tuple(unit == "m" for unit in (units * n if len(units) == 1 else units))

    def _values(self, name: str, hinge: str, slide: str) -> Array:
        """A dataset as float64, its unit checked."""
        values, units = self.numbers(name), self.units(name)
        expected = [hinge] if hinge == slide else [slide if sliding else hinge for sliding in self.slides]
        if units != tuple(expected) and (len(set(expected)) > 1 or units != (expected[0],)):
            shown = expected if len(set(expected)) > 1 else repr(expected[0])
            raise InputError(
                self.path, name, f"unit {shown}", list(units) if len(units) > 1 else repr(units[0])
            )
        return values

    def _controller(self) -> Controller:
        group = self.file["controller"]
        if not isinstance(group, h5py.Group):
            raise InputError(self.path, "controller", "a group", "a dataset")
        kind = self.text(group, "kind")
        if kind not in CONTROLLER_KINDS:
            raise InputError(self.path, "controller kind", "a controller", repr(kind), CONTROLLER_KINDS)
        gains: dict[str, Array] = {}
        for name in ("kp", "kd"):
            if kind != "unknown" or name in group:
                # The format spells no unit of theirs.
                gains[name] = self.numbers(f"controller/{name}")
        needs_smoothing = kind == "pd_with_model_feedforward"
        smoothing = self.number(group, "coulomb_smoothing") if needs_smoothing else None
        # What nothing is known of may have no rate either; it is not used.
        if kind == "unknown" and "rate" not in group.attrs:
            rate = self.number(self.file, "sample_rate")
        else:
            rate = self.number(group, "rate")
        return Controller(kind, rate, coulomb_smoothing=smoothing, **gains)

    def _provenance(self) -> dict[str, Any]:
        """What the log tells of its making, where that is a JSON object; the format asks for none."""
        given = single(self.file.attrs.get("provenance", ""))
        try:
            provenance = json.loads(decoded(given)) if isinstance(given, (str, bytes)) else None
        except json.JSONDecodeError:
            return {}
        return provenance if isinstance(provenance, dict) else {}


def check_recording(recording: Recording, source: object) -> None:
    """Raise InputError, naming ``source``, unless shapes, times and values obey the format."""
    names = recording.joint_names
    if not names or len(set(names)) != len(names) or not all(names):
        raise InputError(source, "joint_names", "distinct names, one a joint", list(names))
    _check_time(recording, source)
    shape = (len(recording.time), len(names))
    for name, channel, _, _ in CHANNELS:
        values = getattr(recording, channel)
        if values is not None:
            _check_values(values, shape, f"{shape}, samples of time by joint_names", name, recording, source)
    if recording.is_slide and len(recording.is_slide) != len(names):
        raise InputError(source, "is_slide", f"{len(names)} flags or none", len(recording.is_slide))
    controller = recording.controller
    if controller is None:
        return
    if controller.kind not in CONTROLLER_KINDS:
        raise InputError(source, "controller kind", "a controller", repr(controller.kind), CONTROLLER_KINDS)
    for name, value in (("rate", controller.rate), ("coulomb_smoothing", controller.coulomb_smoothing)):
        if value is not None and not (np.isfinite(value) and value > 0):
            raise InputError(source, f"controller {name}", "a positive number", value)
    for name, gains in (("kp", controller.kp), ("kd", controller.kd)):
        if gains is not None:
            _check_values(
                gains, shape[1:], f"{shape[1:]}, one a joint", f"controller/{name}", recording, source
            )


def _check_time(recording: Recording, source: object) -> None:
    """Time: (N,) with N >= 2, finite, strictly increasing, and at sample_rate."""
    time, rate = np.asarray(recording.time), recording.sample_rate
    if time.ndim != 1 or len(time) < 2:
        raise InputError(source, "time", "shape (N,) with N >= 2", time.shape)
    if not np.isfinite(time).all():
        sample = int(np.argmin(np.isfinite(time)))
        raise InputError(source, "time", "finite values", f"{time[sample]} at sample {sample}")
    steps = np.diff(time)
    if (steps <= 0).any():
        sample = int(np.argmax(steps <= 0)) + 1
        got = f"{time[sample]:.9g} s after {time[sample - 1]:.9g} s at sample {sample}"
        raise InputError(source, "time", "strictly increasing values", got)
    if not (np.isfinite(rate) and rate > 0):
        raise InputError(source, "sample_rate", "a positive number of Hz", rate)
    measured = 1 / float(np.median(steps))
    if abs(measured / rate - 1) > RATE_TOLERANCE:
        expected = f"{measured:.6g} Hz, one over the median step of time, within {RATE_TOLERANCE:.0%}"
        raise InputError(source, "sample_rate", expected, rate)


def _check_values(
    values: Array, shape: tuple[int, ...], expected: str, name: str, recording: Recording, source: object
) -> None:
    """Shape and finite values; the joint and sample of the first value that is not finite is named."""
    values = np.asarray(values)
    if values.shape != shape:
        raise InputError(source, name, f"shape {expected}", values.shape)
    finite = np.isfinite(values)
    if not finite.all():
        first = np.argwhere(~finite)[0]
        at = f" at sample {first[0]}" if values.ndim == 2 else ""
        got = f"{values[tuple(first)]}{at}, joint {recording.joint_names[first[-1]]}"
        raise InputError(source, name, "finite values", got)
