"""The robot-log format, versions 1 and 1.1: one recorded run in one HDF5 file.

A log without measured torque is of version 1.1: it says what the drive did instead.
"""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from identification.errors import InputError

from .containment.child import contained
from .drive import SIGNALS, Drive, check_drive, drive_units, is_signed, read_drive
from .files import replacing, require_file
from .hdf5 import CheckedFile, opened, write_hdf5
from .html_table import html_table
from .understood import in_order, in_seconds, spelled, without_gaps

Array = NDArray[np.float64]

FORMAT, VERSION, VERSION_OF_DRIVES = "robot-log", 1, 1.1
# Where a recording's provenance keeps, in sentences, what was written otherwise but understood.
UNDERSTOOD = "understood"
POSITION_SERVO = "position_servo"
CONTROLLER_KINDS = ("pd", "pd_with_model_feedforward", POSITION_SERVO, "unknown")
# Median sample interval against sample_rate: clocks of real robots jitter, but not on the whole.
RATE_TOLERANCE = 0.01
# Nothing is measured as more, in any unit; squares of it are no number.
LARGEST = 1e100
# A log is put on a grid, gaps and all, which may be so many times as long as its samples.
MOST_GAPS = 100

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
    ("joint/current", "current", "A", "A"),
    ("joint/duty", "duty", "-", "-"),
    ("joint/voltage", "voltage", "V", "V"),
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
    """What drove the robot. kind: pd, pd_with_model_feedforward, position_servo or unknown. rate: Hz.

    kp, kd: (n,) N·m/rad and N·m·s/rad, or None. coulomb_smoothing: rad/s, of the feedforward, or None.
    delay: s, of a servo's reference, or None. A servo's drive: kp (reference(t - delay) - position) - kd
    velocity.
    """

    kind: str
    rate: float
    kp: Array | None = None
    kd: Array | None = None
    coulomb_smoothing: float | None = None
    delay: float | None = None


@dataclass(frozen=True)
class Recording:
    """One run as a robot-log holds it. N samples, n joints; SI units at the joint.

    time: (N,) s. position: (N, n) rad (m). torque: (N, n) N·m (N), NaN throughout where none was measured.
    velocity, torque_command, temperature: (N, n) or None; rad/s, N·m, degC.
    reference_position, reference_velocity, reference_acceleration: (N, n) or None.
    controller: or None. truth: what only a simulation knows, never read by identification.
    truth_effects: the unmodelled effects in the simulated robot; JSON-able, part of the truth.
    source: what made the log. provenance: scenario, seed, versions; JSON-able.
    is_slide: n flags, which joints slide; empty: every joint is a hinge.
    current, duty, voltage: (N, n) or None; A, share of full PWM, V. unsigned: those without their sign.
    drive: what is known of the drives, or None.
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
    current: Array | None = None
    duty: Array | None = None
    voltage: Array | None = None
    unsigned: tuple[str, ...] = ()
    drive: Drive | None = None

    @property
    def has_torque(self) -> bool:
        """Whether torque was measured."""
        return not bool(np.isnan(self.torque).all())

    @property
    def servo(self) -> Controller | None:
        """The position servos that drove the robot; None where something else did, or nothing says."""
        is_servo = self.controller is not None and self.controller.kind == POSITION_SERVO
        return self.controller if is_servo else None

    @property
    def has_drive(self) -> bool:
        """Whether the log says what the drives did by other than torque, as version 1.1 does."""
        stated = self.servo is not None or self.drive is not None
        return stated or any(getattr(self, name) is not None for name in SIGNALS)

    def torque_units(self) -> tuple[str, ...]:
        """Unit of each joint's torque: N·m for a hinge, N for a slide."""
        slides = self.is_slide or (False,) * len(self.joint_names)
        return tuple("N" if slide else "N·m" for slide in slides)

    def _repr_html_(self) -> str:
        """Each joint's range of motion and torque."""
        rows = zip(
            self.joint_names,
            self.position.min(axis=0).tolist(),
            self.position.max(axis=0).tolist(),
            np.sqrt(np.mean(self.torque**2, axis=0)).tolist(),
            np.abs(self.torque).max(axis=0).tolist(),
            strict=True,
        )
        seconds = self.time[-1] - self.time[0]
        about = f"{self.robot}: {seconds:.4g} s at {self.sample_rate:.4g} Hz, {self.source}"
        headings = ("joint", "position from, rad (m)", "to", "torque RMS, N·m (N)", "largest")
        return html_table(headings, rows, (about,))

    def plot(self) -> Any:
        """Position, and torque where it was measured, over time, as a plotly figure."""
        from .report.run_figures import by_quantity

        shown = {"position, rad (m)": self.position}
        if self.has_torque:
            shown["torque, N·m (N)"] = self.torque
        return by_quantity(self.time, shown, self.joint_names)


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
    recording = contained("testbench.log:read_here", path, "log", expected, *asked, size=size)
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
        rate, provenance = self.number(self.file, "sample_rate"), self._provenance()
        units = self.units("time")
        time, unit = in_seconds(self.numbers("time"), rate, spelled(units[0]))
        if unit != "s":
            provenance = _saying(provenance, f"time stamps are in {unit}: read as seconds")
        elif spelled(units[0]) != "s":
            time = self._values("time", "s", "s")
        return Recording(
            robot=self.text(self.file, "robot"),
            joint_names=self.joint_names,
            sample_rate=rate,
            source=self.text(self.file, "source"),
            time=time,
            controller=self._controller() if self.has("controller") else None,
            truth=truth,
            truth_effects=effects,
            provenance=provenance,
            is_slide=self.slides if any(self.slides) else (),
            unsigned=tuple(
                name
                for name in SIGNALS
                if name in channels and not is_signed(self, self.dataset(f"joint/{name}"))
            ),
            drive=read_drive(self) if has_drives else None,
            **channels,
        )

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
        """What the log tells of its making, where that is a JSON object; the format asks for none."""
        if "provenance" not in self.file.attrs:
            return {}
        try:
            provenance = json.loads(self.text(self.file, "provenance"))
        # RecursionError: brackets without end.
        except (InputError, ValueError, RecursionError):
            return {}
        return provenance if isinstance(provenance, dict) else {}


def _saying(provenance: dict[str, Any], sentence: str) -> dict[str, Any]:
    """A provenance with one more thing that was understood."""
    before = provenance.get(UNDERSTOOD, [])
    return provenance | {UNDERSTOOD: [*(before if isinstance(before, list) else []), sentence]}


def _mended(recording: Recording) -> Recording:
    """The recording with a few NaN in a row interpolated, and without channels that nobody filled."""
    changed: dict[str, Any] = {}
    provenance = recording.provenance
    for name, channel, _, _ in CHANNELS:
        values = getattr(recording, channel)
        if values is None:
            continue
        if channel not in REQUIRED and values.size and np.isnan(values).all():
            changed[channel] = None
            provenance = _saying(provenance, f"{name} is NaN throughout: left out")
            continue
        filled, count = without_gaps(recording.time, values)
        if count:
            changed[channel] = filled
            provenance = _saying(provenance, f"{name} has NaN in {count} samples: interpolated")
    return replace(recording, provenance=provenance, **changed)


def in_model_order(recording: Recording, joint_names: Sequence[str]) -> Recording:
    """The recording with its joints in the model's order where they have its names in another."""
    places = in_order(recording.joint_names, joint_names)
    if places is None:
        return recording
    sorted_ = with_channels(recording, recording.time, lambda _, own: own[:, places])
    controller = recording.controller
    if controller is not None:
        kp, kd = (None if gains is None else gains[places] for gains in (controller.kp, controller.kd))
        controller = replace(controller, kp=kp, kd=kd)
    drive = recording.drive
    if drive is not None:
        figures: dict[str, Any] = {name: values[places] for name, values in drive.figures().items()}
        drive = replace(drive, **figures)
    slides = tuple(recording.is_slide[place] for place in places) if recording.is_slide else ()
    return replace(
        sorted_,
        joint_names=tuple(joint_names),
        is_slide=slides,
        controller=controller,
        drive=drive,
        provenance=_saying(
            recording.provenance, "joints are in another order than the model's: sorted by name"
        ),
    )


def saying(recording: Recording, sentence: str) -> Recording:
    """The recording with one more thing that was understood of it, for its reader."""
    return replace(recording, provenance=_saying(recording.provenance, sentence))


def check_recording(recording: Recording, source: object) -> None:
    """Raise InputError, naming ``source``, unless shapes, times and values obey the format."""
    names = recording.joint_names
    if not names or len(set(names)) != len(names) or not all(names):
        raise InputError(source, "joint_names", "distinct names, one a joint", list(names))
    _check_time(recording, source)
    shape = (len(recording.time), len(names))
    for name, channel, _, _ in CHANNELS:
        values = getattr(recording, channel)
        is_replaced = channel == "torque" and recording.has_drive and not recording.has_torque
        if values is not None and not is_replaced:
            _check_values(values, shape, f"{shape}, samples of time by joint_names", name, recording, source)
    if recording.is_slide and len(recording.is_slide) != len(names):
        raise InputError(source, "is_slide", f"{len(names)} flags or none", len(recording.is_slide))
    if recording.drive is not None:
        check_drive(recording.drive, names, source)
    controller = recording.controller
    if controller is None:
        return
    if controller.kind not in CONTROLLER_KINDS:
        raise InputError(source, "controller kind", "a controller", repr(controller.kind), CONTROLLER_KINDS)
    for name, value in (("rate", controller.rate), ("coulomb_smoothing", controller.coulomb_smoothing)):
        if value is not None and not (np.isfinite(value) and value > 0):
            raise InputError(source, f"controller {name}", "a positive number", value)
    if controller.delay is not None and not 0 <= controller.delay < np.inf:
        raise InputError(source, "controller delay", "a number of seconds from 0 on", controller.delay)
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
    longest = MOST_GAPS * len(time) / rate
    if not time[-1] - time[0] <= longest:
        expected = f"{len(time)} samples within {longest:.4g} s, {MOST_GAPS} times as long as they take"
        raise InputError(source, "time", expected, f"{time[-1] - time[0]:.4g} s from first to last")
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
    finite = is_measurable(values)
    if not finite.all():
        first = np.argwhere(~finite)[0]
        at = f" at sample {first[0]}" if values.ndim == 2 else ""
        got = f"{values[tuple(first)]}{at}, joint {recording.joint_names[first[-1]]}"
        raise InputError(source, name, f"finite values up to {LARGEST:g}", got)


def is_measurable(values: Array) -> NDArray[np.bool_]:
    """Which values are finite, and no larger than anything is measured as."""
    # Of NaN neither is so.
    return np.asarray(np.abs(values) <= LARGEST)
