"""The mapping file: which columns of a recording are which signal of which joint, and in which unit.

One file serves every recording of the same columns: it is guessed once, corrected, and used for a folder of
runs.
"""

from pathlib import Path
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from identification.errors import InputError
from testbench.drive import DRIVE_KINDS
from testbench.scenario import first_fault
from testbench.yaml_file import read_fields

from .units import SI, TIME, UNITS, factor_of, known_unit

QUANTITIES = tuple(UNITS)
# Signals of a drive, whose sign may be lost.
MAY_BE_UNSIGNED = ("current", "duty", "voltage")
ABSOLUTE = "absolute"

Number = Annotated[float, Field(allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
Numbers = Number | tuple[Number, ...]


class _Section(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class TimeSection(_Section):
    """Where time stamps are: in a column of every stream, or nowhere: samples are even at ``rate``, Hz."""

    column: str | None = None
    unit: str = "s"
    rate: Positive | None = None

    @model_validator(mode="after")
    def _one_of_both(self) -> "TimeSection":
        if (self.column is None) == (self.rate is None):
            raise ValueError("either a column of time stamps or a rate in Hz")
        if known_unit(self.unit) not in TIME:
            raise ValueError(f"a unit of time ({', '.join(TIME)})")
        return self


class ChannelSection(_Section):
    """Columns of one quantity, one a joint in the order of ``joints``; numbers are for all joints or one
    each.

    A value becomes ``sign`` times (value minus ``zero``) times ``unit``, or times ``scale``: what one is in
    SI units. side: motor for what is measured before the gearbox.
    """

    columns: tuple[str, ...]
    unit: str | tuple[str, ...] | None = None
    scale: Numbers | None = None
    sign: Literal["absolute"] | Numbers = 1.0
    zero: Numbers = 0.0
    side: Literal["joint", "motor"] = "joint"

    @model_validator(mode="after")
    def _one_scale(self) -> "ChannelSection":
        if (self.unit is None) == (self.scale is None):
            raise ValueError("either a unit or a scale")
        return self


class DriveSection(_Section):
    """Data of the drives, as in a robot-log's group ``drive``."""

    kind: str
    torque_per_unit: Numbers | None = None
    back_emf: Numbers | None = None
    spread: Numbers | None = None
    limit: Numbers | None = None

    @model_validator(mode="after")
    def _known_kind(self) -> "DriveSection":
        if self.kind not in DRIVE_KINDS:
            raise ValueError(f"a kind of drive ({', '.join(DRIVE_KINDS)})")
        return self


class ControllerSection(_Section):
    """A position servo: kp, N·m/rad, kd, N·m·s/rad, and the delay of its reference, s, as far as known."""

    kind: Literal["position_servo"] = "position_servo"
    kp: Numbers
    kd: Numbers = 0.0
    delay: Annotated[float, Field(ge=0, allow_inf_nan=False)] | None = None


class Mapping(_Section):
    """A whole mapping file.

    joints: names, in the order of every list here. channels: by quantity. gear_ratio: turns of the motor for
    one of the joint. torque_constant: N·m at the motor for 1 A. episode: which run of a file that holds
    several.
    """

    format: Literal["recording-map"] = "recording-map"
    format_version: Literal[1] = 1
    robot: str = ""
    episode: int | None = None
    time: TimeSection
    joints: tuple[str, ...]
    channels: dict[str, ChannelSection]
    gear_ratio: Numbers | None = None
    torque_constant: Numbers | None = None
    drive: DriveSection | None = None
    controller: ControllerSection | None = None

    @model_validator(mode="after")
    def _consistent(self) -> "Mapping":
        if not self.joints or len(set(self.joints)) != len(self.joints):
            raise ValueError("distinct joints")
        if "position" not in self.channels:
            raise ValueError("channels with position among them")
        for quantity, channel in self.channels.items():
            _check_channel(quantity, channel, self)
        for name, section in (("mapping", self), ("drive", self.drive), ("controller", self.controller)):
            for field in (
                "gear_ratio",
                "torque_constant",
                "torque_per_unit",
                "back_emf",
                "spread",
                "limit",
                "kp",
                "kd",
            ):
                _check_count(f"{name} {field}", getattr(section, field, None), self)
        return self


def _check_channel(quantity: str, channel: ChannelSection, mapping: Mapping) -> None:
    """Raise ValueError for a channel that does not fit its quantity or the joints."""
    if quantity not in QUANTITIES:
        raise ValueError(f"channels among {', '.join(QUANTITIES)}, not {quantity}")
    if len(channel.columns) != len(mapping.joints):
        raise ValueError(f"{len(mapping.joints)} columns of {quantity}, one a joint")
    for field in ("unit", "scale", "sign", "zero"):
        _check_count(f"{quantity} {field}", getattr(channel, field), mapping)
    units = (channel.unit,) if isinstance(channel.unit, str) else channel.unit or ()
    for unit in units:
        if all(factor_of(quantity, unit, slide) is None for slide in (False, True)):
            known = [SI, *UNITS[quantity][0], *UNITS[quantity][1]]
            raise ValueError(f"a unit of {quantity} ({', '.join(dict.fromkeys(known))}), not {unit!r}")
    if channel.sign == ABSOLUTE and quantity not in MAY_BE_UNSIGNED:
        raise ValueError(f"a sign of {quantity}: only {', '.join(MAY_BE_UNSIGNED)} may be absolute")
    if channel.side == "motor" and mapping.gear_ratio is None:
        raise ValueError(f"a gear_ratio, since {quantity} is of the motor")


def _check_count(field: str, values: object, mapping: Mapping) -> None:
    if isinstance(values, tuple) and len(values) != len(mapping.joints):
        raise ValueError(f"{len(mapping.joints)} values of {field}, one a joint, or one for all")


def read_mapping(path: Path) -> Mapping:
    """The mapping in a YAML file. Raises InputError naming the file, the field and the rule it breaks."""
    content = read_fields(path, "mapping")
    try:
        return Mapping.model_validate(content)
    except ValidationError as error:
        fault = error.errors()[0]
        if not fault["loc"] or fault["type"] == "value_error":
            field = ".".join(str(part) for part in fault["loc"]) or "mapping"
            expected = fault["msg"].removeprefix("Value error, ")
            raise InputError(path, field, expected, "something else") from None
        raise first_fault(path, Mapping, error) from None
