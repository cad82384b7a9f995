"""A table and a mapping to a recording in SI units at the joint."""

from collections.abc import Mapping as Map
from collections.abc import Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from typing import Any

import numpy as np
from numpy.typing import NDArray

from identification.errors import InputError
from testbench.drive import Drive
from testbench.log import Controller, Recording
from testbench.sampling import SMOOTH, interpolated

from .mapping import ABSOLUTE, ChannelSection, ControllerSection, DriveSection, Mapping
from .stamps import Sampled, later, sampled
from .table import Column, Numbers, Stream, Table
from .units import TIME, factor_of, known_unit
from .wraps import TURN, turns

Array = NDArray[np.float64]

# Names that a complaint lists at most.
LISTED = 8
FEWEST = 10
DIGITS = 9
# Hz; lags, presliding and backlash act within hundredths of a second.
SLOW = 100.0


@dataclass(frozen=True)
class Converted:
    """A recording, and what was done to it, in words."""

    recording: Recording
    notes: tuple[str, ...]


def converted(table: Table, mapping: Mapping, is_slide: Sequence[bool], robot: str = "") -> Converted:
    """The recording that a mapping makes of a table.

    is_slide: n flags, in the order of the mapping's joints. robot: the name that the recording gets where
    neither mapping nor table has one. Raises InputError naming the table's file.
    """
    columns = {column.name: column for column in table.columns()}
    found = {name: _find(channel.columns, columns, name, table) for name, channel in mapping.channels.items()}
    streams = list(dict.fromkeys(column.stream.name for each in found.values() for column in each))
    clocks = {name: _clock(_stream(table, name), _used(found, name), mapping, table) for name in streams}
    base = found["position"][0].stream.name
    notes = [f"{name}: {note}" if name else note for name in streams for note in clocks[name].notes]
    time, rows = _time_base(found["position"], clocks, base, table, notes)
    values: dict[str, Array | None] = {}
    for quantity, channel in mapping.channels.items():
        taken = _taken(found[quantity], clocks, base, time, rows, quantity in SMOOTH)
        cleaned = _cleaned(taken, quantity, mapping.joints, time, notes)
        values[quantity] = None if cleaned is None else _in_si(cleaned, quantity, channel, mapping, is_slide)
    _unwrap(values, mapping.joints, is_slide, notes)
    torque = values.pop("torque", None)
    unsigned = tuple(
        name for name, each in mapping.channels.items() if each.sign == ABSOLUTE and values[name] is not None
    )
    logged: dict[str, Any] = {name: each for name, each in values.items() if each is not None}
    # Further digits are those of the stamps.
    rate = float(f"{1 / float(np.median(np.diff(time))):.{DIGITS}g}")
    if rate < SLOW:
        notes.append(
            f"{rate:.3g} Hz is too slow for most effects of drives and gears: log at {SLOW:g} Hz or more"
        )
    recording = Recording(
        robot=mapping.robot or table.robot or robot or table.path.stem,
        joint_names=mapping.joints,
        sample_rate=rate,
        source="hardware",
        time=time,
        torque=np.full_like(logged["position"], np.nan) if torque is None else torque,
        controller=_controller(mapping.controller, len(mapping.joints), rate),
        provenance=_provenance(table, clocks[base]),
        is_slide=tuple(is_slide) if any(is_slide) else (),
        unsigned=unsigned,
        drive=_drive(mapping, values),
        **logged,
    )
    return Converted(recording, tuple(notes))


def _find(names: Sequence[str], columns: Map[str, Column], quantity: str, table: Table) -> list[Column]:
    for name in names:
        if name not in columns:
            near = get_close_matches(name, columns, LISTED, 0.3) or list(columns)[:LISTED]
            expected = f"a column of the {table.format} file"
            raise InputError(table.path, f"map: {quantity}", expected, f"{name!r}, which it has not", near)
    return [columns[name] for name in names]


def _stream(table: Table, name: str) -> Stream:
    return next(stream for stream in table.streams if stream.name == name)


def _used(found: Map[str, list[Column]], stream: str) -> Numbers:
    """The values (N, k) that are taken of a stream."""
    columns = [column.values for each in found.values() for column in each if column.stream.name == stream]
    return np.column_stack(columns)


def _clock(stream: Stream, values: Numbers, mapping: Mapping, table: Table) -> Sampled:
    """When a stream was sampled."""
    if mapping.time.column is None:
        assert mapping.time.rate is not None
        rows = np.arange(stream.samples)
        return Sampled(rows, rows / mapping.time.rate, 0, 1.0, ())
    stamps = {name: channel.values[:, 0] for channel in stream.channels for name in channel.columns()[:1]}
    if mapping.time.column not in stamps:
        near = get_close_matches(mapping.time.column, stamps, LISTED, 0.3) or list(stamps)[:LISTED]
        got = f"{mapping.time.column!r}, which {stream.name or 'it'} has not"
        raise InputError(table.path, "map: time.column", "a column of time stamps", got, near)
    seconds = TIME[known_unit(mapping.time.unit)]
    return sampled(stamps[mapping.time.column], seconds, values, table.path, mapping.time.column)


def _time_base(
    position: list[Column], clocks: Map[str, Sampled], base: str, table: Table, notes: list[str]
) -> tuple[Array, NDArray[np.int64]]:
    """Instants (M,) s at which all streams are known and positions are, and the base stream's rows there."""
    clock = clocks[base]
    first = max(later(each, clock) + each.time[0] for each in clocks.values())
    last = min(later(each, clock) + each.time[-1] for each in clocks.values())
    inside = (clock.time >= first) & (clock.time <= last)
    own = [column.values[clock.rows] for column in position if column.stream.name == base]
    measured = np.all(np.isfinite(np.column_stack(own).astype(np.float64)), axis=1)
    lacking = int(np.sum(inside & ~measured))
    if lacking:
        notes.append(f"{lacking} of {len(measured)} samples have no position of every joint: left out")
    kept = inside & measured
    if np.sum(kept) < FEWEST:
        expected = f"at least {FEWEST} samples with the position of every joint"
        raise InputError(table.path, "position", expected, int(kept.sum()))
    if not inside.all():
        notes.append(f"{int(np.sum(~inside))} samples lie outside what all topics cover: left out")
    return clock.time[kept], clock.rows[kept]


def _taken(
    columns: list[Column],
    clocks: Map[str, Sampled],
    base: str,
    time: Array,
    rows: NDArray[np.int64],
    is_smooth: bool,
) -> Array:
    """Values (M, n) of these columns at the base stream's instants."""
    taken = np.empty((len(time), len(columns)))
    for index, column in enumerate(columns):
        values = column.values.astype(np.float64)
        if column.stream.name == base:
            taken[:, index] = values[rows]
            continue
        clock = clocks[column.stream.name]
        own, at = values[clock.rows], clock.time + later(clock, clocks[base])
        known = np.isfinite(own)
        if np.sum(known) < FEWEST:
            taken[:, index] = np.nan
        else:
            taken[:, index] = interpolated(at[known], own[known, np.newaxis], time, is_smooth)[:, 0]
    return taken


def _cleaned(
    values: Array, quantity: str, joints: Sequence[str], time: Array, notes: list[str]
) -> Array | None:
    """Values (M, n) with what is NaN between numbers interpolated; None where a joint has none at all."""
    known = np.isfinite(values)
    without = [joints[joint] for joint in np.flatnonzero(~known.any(axis=0)).tolist()]
    if without:
        of = "" if len(without) == len(joints) else f" of {', '.join(without)}"
        notes.append(f"{quantity}{of} is NaN at every sample: this log has no {quantity}")
        return None
    for joint in np.flatnonzero(~known.all(axis=0)).tolist():
        own = known[:, joint]
        values[:, joint] = np.interp(time, time[own], values[own, joint])
        notes.append(f"{quantity} of {joints[joint]} is NaN at {int(np.sum(~own))} samples: interpolated")
    return values


def _each(value: Any, count: int) -> Array:
    """A number for all joints, or one each, as (n,)."""
    return np.broadcast_to(np.asarray(value, dtype=np.float64), (count,))


def _in_si(
    values: Array, quantity: str, channel: ChannelSection, mapping: Mapping, is_slide: Sequence[bool]
) -> Array:
    """Values (M, n) in SI units at the joint, with their sign and zero."""
    count = len(mapping.joints)
    if channel.scale is not None:
        scale = _each(channel.scale, count).copy()
    else:
        units = (channel.unit,) * count if isinstance(channel.unit, str) else channel.unit or ()
        factors = [factor_of(quantity, unit, slide) for unit, slide in zip(units, is_slide, strict=True)]
        for joint, unit, factor in zip(mapping.joints, units, factors, strict=True):
            if factor is None:
                kind = "slide joint" if is_slide[mapping.joints.index(joint)] else "hinge"
                raise InputError("map", f"{quantity}.unit", f"a unit for the {kind} {joint}", repr(unit))
        scale = np.array(factors, dtype=np.float64)
    if channel.side == "motor":
        ratio = _each(mapping.gear_ratio, count)
        scale = scale * ratio if quantity in ("torque", "torque_command") else scale / ratio
    shifted = values - _each(channel.zero, count)
    if channel.sign == ABSOLUTE:
        return np.asarray(np.abs(shifted) * scale)
    return np.asarray(shifted * scale * _each(channel.sign, count))


def _unwrap(
    values: dict[str, Array | None], joints: Sequence[str], is_slide: Sequence[bool], notes: list[str]
) -> None:
    """Make positions of hinges continuous, and references those of the same turn."""
    for quantity in ("position", "reference_position"):
        table = values.get(quantity)
        if table is None:
            continue
        off = np.where(is_slide, 0.0, turns(table))
        table -= TURN * off
        for joint in np.flatnonzero(off.any(axis=0)).tolist():
            notes.append(f"{quantity} of {joints[joint]} jumps by a turn: made continuous")
    position, reference = values["position"], values.get("reference_position")
    if position is not None and reference is not None:
        apart = TURN * np.round(np.median(reference - position, axis=0) / TURN)
        reference -= np.where(is_slide, 0.0, apart)


def _drive(mapping: Mapping, values: Map[str, Array | None]) -> Drive | None:
    """Drive data from the map, or its torque constants and gear ratios if currents were logged, or None."""
    count = len(mapping.joints)
    section = mapping.drive
    if section is None:
        if mapping.torque_constant is None or values.get("current") is None:
            return None
        ratio = 1.0 if mapping.gear_ratio is None else _each(mapping.gear_ratio, count)
        return Drive("current", _each(mapping.torque_constant, count) * ratio)
    figures = {
        name: _each(getattr(section, name), count).copy()
        for name in DriveSection.model_fields
        if name != "kind" and getattr(section, name) is not None
    }
    return Drive(section.kind, **figures)


def _controller(section: ControllerSection | None, count: int, rate: float) -> Controller | None:
    if section is None:
        return None
    gains = (_each(section.kp, count).copy(), _each(section.kd, count).copy())
    return Controller(section.kind, rate, *gains, delay=section.delay)


def _provenance(table: Table, clock: Sampled) -> dict[str, Any]:
    """Where the recording is from; no time of writing, so that one input gives one output."""
    facts: dict[str, Any] = {
        "file": table.path.name,
        "format": table.format,
        "first_stamp": clock.start * clock.seconds,
    }
    if table.episode is not None:
        facts["episode"] = table.episode
    return facts | {f"recorded_{name}": value for name, value in sorted(table.facts.items())}
