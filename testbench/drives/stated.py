"""Position servos as a user states them: by options, by a small YAML file, or in the log itself."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, Protocol

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from identification.errors import InputError

from ..log import Recording
from ..model_reading.limits import Limits
from ..scenario import first_fault
from ..yaml_file import read_fields

Array = NDArray[np.float64]

# Relative standard deviation of gains that are stated without one.
GAIN_SPREAD = 0.1
# That of kd over kp: both are numbers in one firmware, and the torque of a unit of current scales both.
RATIO_SPREAD = 0.03
# s, the range of the delay where none is stated.
LONGEST_DELAY = 0.1

NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
Numbers = NotNegative | tuple[NotNegative, ...]


class StatedDrive(BaseModel):
    """Position servos as stated. Numbers are for all joints, or one a joint in the model's order.

    kp, kd: gains, or gains by run. factor: N·m/rad (N·m·s/rad) for one unit, as a firmware counts.
    spread: relative standard deviation of each gain; ratio_spread: that of kd over kp. delay: s, lowest and
    highest. limit: N·m of the drive; limit_spread: its relative standard deviation. stall, no_load_speed: N·m
    and rad/s at the full voltage, of servos that set a voltage; stall_spread: of what speed takes of it,
    relative.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    kind: Literal["position_servo"] = "position_servo"
    kp: Numbers | dict[str, Numbers] | None = None
    kd: Numbers | dict[str, Numbers] | None = None
    factor: Positive = 1.0
    spread: Annotated[float, Field(ge=0, le=1)] | None = None
    ratio_spread: Annotated[float, Field(gt=0, le=1)] = RATIO_SPREAD
    delay: tuple[NotNegative, NotNegative] | None = None
    limit: Positive | tuple[Positive, ...] | None = None
    limit_spread: Annotated[float, Field(ge=0, le=1)] = 0.0
    stall: Positive | tuple[Positive, ...] | None = None
    no_load_speed: Positive | tuple[Positive, ...] | None = None
    stall_spread: Annotated[float, Field(ge=0, le=1)] = 0.3

    @model_validator(mode="after")
    def _consistent(self) -> "StatedDrive":
        if self.delay is not None and self.delay[1] < self.delay[0]:
            raise ValueError("delay: the lowest before the highest")
        if (self.stall is None) != (self.no_load_speed is None):
            raise ValueError("stall: with no_load_speed, the other end of the motor's line at full voltage")
        return self


def read_stated(path: Path) -> StatedDrive:
    """The drives of a YAML file. Raises InputError naming the file, the field and the rule it breaks."""
    content = read_fields(path, "drive")
    try:
        return StatedDrive.model_validate(content)
    except ValidationError as error:
        raise first_fault(path, StatedDrive, error) from None


def stated_by_options(**options: Any) -> StatedDrive:
    """The drives of command-line options; those that are None were not given. Raises InputError."""
    given = {name: value for name, value in options.items() if value is not None}
    try:
        return StatedDrive.model_validate(given)
    except ValidationError as error:
        fault = error.errors()[0]
        field = ".".join(str(part) for part in fault["loc"][:1]) or "drive"
        raise InputError("testbench", f"--{field}", fault["msg"], repr(given.get(field))) from None


class Jointed(Protocol):
    """A robot as far as its drives are concerned."""

    @property
    def joint_names(self) -> tuple[str, ...]:
        """n names."""
        ...

    @property
    def limits(self) -> Limits:
        """Of the joints."""
        ...


@dataclass(frozen=True)
class Voltage:
    """Of servos that set a voltage, (n,) each at the full one: stall torque N·m, and what of it speed takes.

    What scales kp scales the stall torque as well: both are the motor's constant times a share of the
    voltage. back_emf: N·m·s/rad. spread: relative standard deviation of it.
    """

    stall: Array
    back_emf: Array
    spread: Array


@dataclass(frozen=True)
class Servo:
    """The servos of one run, (n,) each: kp, kd N·m/rad and N·m·s/rad; relative spread; delay s; limit N·m.

    voltage: None for servos that set a torque. ratio_spread: relative, of kd over kp.
    """

    kp: Array
    kd: Array
    spread: Array
    delay_lower: Array
    delay_upper: Array
    limit: Array
    limit_spread: Array
    voltage: Voltage | None = None
    ratio_spread: float = RATIO_SPREAD


def servo_of(
    stated: StatedDrive | None, recording: Recording, name: str, robot: Jointed, path: Path
) -> Servo:
    """The servos as stated, else as the log says. Raises InputError where neither has gains."""
    logged = recording.servo
    stated = stated or StatedDrive()
    gains = {}
    for gain in ("kp", "kd"):
        given = getattr(stated, gain)
        own = None if logged is None else getattr(logged, gain)
        if isinstance(given, dict):
            if name not in given:
                raise InputError(path, f"drive {gain}", f"a gain of the run {name}", "none", given)
            given = given[name]
        if given is None and own is None and gain == "kp":
            expected = "the servos' gains: --kp and --kd, --drive FILE.yaml, or a controller in the log"
            raise InputError(path, "kp", expected, "none")
        if given is None:
            gains[gain] = (
                np.zeros(len(robot.joint_names)) if own is None else np.asarray(own, dtype=np.float64)
            )
        else:
            gains[gain] = stated.factor * _each(given, robot, f"drive {gain}", path)
    if not np.all(gains["kp"] > 0):
        joint = robot.joint_names[int(np.argmin(gains["kp"]))]
        raise InputError(path, "kp", "positive gains", f"{gains['kp'].min():g} at {joint}")
    drive = recording.drive
    spread = GAIN_SPREAD if stated.spread is None else stated.spread
    limit = robot.limits.torque
    if drive is not None and drive.limit is not None:
        limit = np.where(np.isfinite(drive.limit), drive.limit, limit)
    if stated.limit is not None:
        limit = _each(stated.limit, robot, "drive limit", path)
    lower, upper = stated.delay or (0.0, LONGEST_DELAY)
    full = np.ones(len(robot.joint_names))
    spreads = spread * full
    if stated.spread is None and drive is not None and drive.spread is not None:
        spreads = np.where(np.isfinite(drive.spread), drive.spread, spreads)
    voltage = None
    if stated.stall is not None and stated.no_load_speed is not None:
        stall, fastest = (
            _each(getattr(stated, name), robot, f"drive {name}", path) for name in ("stall", "no_load_speed")
        )
        voltage = Voltage(stall, stall / fastest, stated.stall_spread * full)
    return Servo(
        gains["kp"],
        gains["kd"],
        spreads,
        lower * full,
        upper * full,
        limit,
        stated.limit_spread * full,
        voltage,
        stated.ratio_spread,
    )


def _each(values: float | Sequence[float], robot: Jointed, field: str, path: Path) -> Array:
    """One value a joint. Raises InputError for another number of them."""
    if np.ndim(values) == 1 and len(np.atleast_1d(values)) not in (1, len(robot.joint_names)):
        expected = f"one value, or {len(robot.joint_names)}, one a joint"
        raise InputError(path, field, expected, f"{len(np.atleast_1d(values))} values")
    return np.broadcast_to(np.asarray(values, dtype=np.float64), (len(robot.joint_names),)).copy()
