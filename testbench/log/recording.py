"""One recorded run: what a robot-log holds, as arrays in SI units at the joint."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from identification.errors import InputError

from ..drive import SIGNALS, Drive
from ..html_table import html_table
from ..understood import in_order

Array = NDArray[np.float64]

# Where a recording's provenance keeps, in sentences, what was written otherwise but understood.
UNDERSTOOD = "understood"
POSITION_SERVO = "position_servo"

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
        from ..report.run_figures import by_quantity

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
    in_order_ = replace(
        sorted_,
        joint_names=tuple(joint_names),
        is_slide=slides,
        controller=controller,
        drive=drive,
    )
    return saying(in_order_, "joints are in another order than the model's: sorted by name")


def saying(recording: Recording, sentence: str) -> Recording:
    """The recording with one more thing that was understood of it, for its reader."""
    before = recording.provenance.get(UNDERSTOOD, [])
    sentences = [*(before if isinstance(before, list) else []), sentence]
    return replace(recording, provenance=recording.provenance | {UNDERSTOOD: sentences})
