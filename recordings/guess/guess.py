"""Which columns are which signal of which joint, and in which unit."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identification.errors import InputError

from ..joints import Joints, joints_named
from ..mapping import ABSOLUTE, MAY_BE_UNSIGNED, QUANTITIES, ChannelSection, Mapping
from ..stamps import sampled
from ..table import UNNAMED, Column, Stream, Table
from ..units import SI, TIME, UNITS, factor_of, known_unit
from ..wraps import unwrapped
from . import plausible
from .clock import Clock, clock_of, time_columns
from .groups import Group, groups_of, names_in
from .unnamed import unnamed_groups

Array = NDArray[np.float64]

# Columns that a complaint lists at most.
LISTED = 12


@dataclass(frozen=True)
class Guess:
    """A mapping, the reason of each of its parts, and what it leaves out.

    reasons: by ``time``, ``joints`` and quantity. is_slide: n flags of its joints.
    """

    mapping: Mapping
    reasons: dict[str, str]
    left_out: tuple[str, ...]
    is_slide: tuple[bool, ...]


@dataclass(frozen=True)
class _Motion:
    """Positions (M, n) in SI units at instants (M,) s, of these rows of this stream."""

    stream: str
    rows: NDArray[np.int64]
    time: Array
    position: Array


def guess_mapping(table: Table, joints: Joints | None = None) -> Guess:
    """The mapping that a table most likely has. joints: the model's, or None.

    Raises InputError where no positions or no time stamps are found.
    """
    if joints is None:
        joints = joints_named(names_in(table))
    groups = _groups(table, joints)
    first = _best(groups, "position", joints, None)
    if first is None:
        names = [group.title for group in groups][:LISTED]
        expected = "columns of joint positions; where there are some, write a map (docs/import.md)"
        raise InputError(table.path, "position", expected, "none known by its name or format", names)
    placed, why = first.by_joint(len(joints.names))
    chosen = sorted(placed)
    if joints.are_of_model and len(chosen) < len(joints.names) and not first.is_named(len(joints.names)):
        expected = f"a column for each of the model's {len(joints.names)} joints, or --joints with the logged"
        got = f"{len(chosen)} columns without a joint's name ({first.title})"
        raise InputError(table.path, "position", expected, got, joints.names)
    joints = joints.some(chosen)
    stream = next(each for each in table.streams if each.name == first.stream)
    clock = clock_of(table, stream)
    columns = [placed[joint] for joint in chosen]
    channel, reason, motion = _position(table, first, columns, joints, stream, clock)
    channels, reasons = {"position": channel}, {"time": clock.why, "position": f"{why}; {reason}"}
    taken, left_out = {id(first)}, list(table.left_out)
    for quantity in QUANTITIES[1:]:
        group = _best([each for each in groups if id(each) not in taken], quantity, joints, first, chosen)
        if group is None:
            continue
        taken.add(id(group))
        named, why = group.by_joint(max(chosen) + 1)
        found = _channel(quantity, group, [named[joint] for joint in chosen], joints, motion, channels)
        quantity = found.quantity
        if found.channel is None or quantity in channels:
            left_out.append(f"{group.title}: {found.reason}")
        else:
            channels[quantity], reasons[quantity] = found.channel, f"{why}; {found.reason}"
    others = [group for group in groups if id(group) not in taken]
    left_out += _unused(
        others, [group for group in groups if id(group) in taken], clock, channels, len(placed)
    )
    mapping = Mapping(time=clock.section, joints=joints.names, channels=channels)
    return Guess(mapping, reasons, tuple(left_out), joints.is_slide)


def _unused(
    others: Sequence[Group],
    taken: Sequence[Group],
    clock: Clock,
    channels: dict[str, ChannelSection],
    joints: int,
) -> list[str]:
    """The groups that are not taken and why, and the columns of the others that are no joint's."""
    found = []
    for group in others:
        if clock.section.column not in [member.column.name for member in group.members]:
            fits, unplaced = group.by_joint(joints)
            found.append(f"{group.title}: {group.why or ('another is taken' if fits else unplaced)}")
    used = {name for each in channels.values() for name in each.columns}
    for group in taken:
        spare = [member.column.name for member in group.members if member.column.name not in used]
        if 0 < len(spare) < len(group.members):
            found.append(f"{', '.join(spare)}: no joint of the model")
    return found


def _groups(table: Table, joints: Joints) -> list[Group]:
    """The table's groups but those of time stamps; blocks of columns where nothing has a name."""
    times = time_columns(table.streams)
    groups = [
        group
        for group in groups_of(table, joints)
        if not all(member.column.name in times for member in group.members)
    ]
    unnamed = all(channel.name.startswith(UNNAMED) for stream in table.streams for channel in stream.channels)
    if unnamed and joints.are_of_model:
        clock = clock_of(table, table.streams[0])
        return unnamed_groups(table, joints, clock.section.column)
    return groups


def _best(
    groups: Sequence[Group], quantity: str, joints: Joints, beside: Group | None, chosen: Sequence[int] = ()
) -> Group | None:
    """The group of a quantity that has the most joints; then one of the stream with the drive's signals.

    beside: the group of positions. chosen: joints that it must have.
    """
    driven = {group.stream for group in groups if group.quantity in ("torque", *MAY_BE_UNSIGNED)}
    best, highest = None, (0, False, False)
    for group in groups:
        count = max(chosen, default=len(joints.names) - 1) + 1
        placed = group.by_joint(count)[0] if group.quantity == quantity else {}
        if not placed or not set(chosen) <= set(placed):
            continue
        rank = (len(placed), beside is not None and group.stream == beside.stream, group.stream in driven)
        if rank > highest:
            best, highest = group, rank
    return best


def _position(
    table: Table, group: Group, columns: list[Column], joints: Joints, stream: Stream, clock: Clock
) -> tuple[ChannelSection, str, _Motion]:
    """The channel of positions, why it is in its unit, and the motion."""
    raw = np.column_stack([column.values for column in columns]).astype(np.float64)
    own = [column.stream.name == stream.name for column in columns]
    if not all(own) or not np.isfinite(raw).all(axis=1).any():
        raise InputError(table.path, "position", "positions of every joint in one topic", "none at all")
    assert clock.section.column is not None
    stamps = next(each for each in stream.channels if each.columns()[0] == clock.section.column).values[:, 0]
    seconds = TIME[known_unit(clock.section.unit)]
    samples = sampled(stamps, seconds, raw, table.path, clock.section.column)
    known = np.isfinite(raw[samples.rows]).all(axis=1)
    rows, time = samples.rows[known], samples.time[known]
    unit, why = _stated("position", group, joints) or plausible.position_units(raw[rows], joints)
    units = (unit,) * len(columns) if isinstance(unit, str) else unit
    factors = np.array(
        [factor_of("position", each, slide) for each, slide in zip(units, joints.is_slide, strict=True)]
    )
    position = raw[rows] * factors
    hinges = ~np.asarray(joints.is_slide)
    position[:, hinges] = unwrapped(position[:, hinges])
    off = plausible.turns_off(position, joints)
    channel = ChannelSection(columns=tuple(column.name for column in columns), unit=unit)
    if off.any():
        channel = channel.model_copy(update={"zero": tuple(np.round(off / factors, 9).tolist())})
        why += f"; whole turns off at {', '.join(np.array(joints.names)[off != 0])}"
    return channel, why, _Motion(stream.name, rows, time, position - off)


def _stated(quantity: str, group: Group, joints: Joints) -> tuple[str, str] | None:
    """The unit that a group's names state, and why; None where they state none of this quantity."""
    for unit in (group.unit, f"{group.unit}/s", f"{group.unit}/s²"):
        if group.unit and all(factor_of(quantity, unit, slide) is not None for slide in set(joints.is_slide)):
            return unit, "SI, as the format has it" if unit == SI else f"{unit} as stated"
    return None


@dataclass(frozen=True)
class _Found:
    """A channel, or None, of what a group turned out to be, and why."""

    quantity: str
    channel: ChannelSection | None
    reason: str


def _channel(
    quantity: str,
    group: Group,
    columns: list[Column],
    joints: Joints,
    motion: _Motion,
    channels: dict[str, ChannelSection],
) -> _Found:
    """Guess of how a group of columns holds this quantity, by its name and its values."""
    values = np.column_stack([column.values for column in columns]).astype(np.float64)
    if np.isnan(values).all():
        return _Found(quantity, None, f"NaN at every sample: this log has no {quantity}")
    if quantity in ("torque", "torque_command", *MAY_BE_UNSIGNED) and not np.nan_to_num(values).any():
        return _Found(quantity, None, f"0 at every sample: this log has no {quantity}")
    names = tuple(column.name for column in columns)
    together = motion.rows if all(column.stream.name == motion.stream for column in columns) else None
    stated = _stated(quantity, group, joints)
    if quantity == "velocity" and together is not None:
        return _velocity(names, values[together], stated, joints, motion, channels)
    unit, why = stated or _likely_unit(quantity, values, together, joints, motion, channels)
    if not unit:
        return _Found(quantity, None, why)
    channel = ChannelSection(columns=names, unit=unit)
    may_lack_sign = quantity in MAY_BE_UNSIGNED and together is not None
    if may_lack_sign and plausible.lost_its_sign(values[together], motion.position):
        channel = channel.model_copy(update={"sign": ABSOLUTE})
        why += "; never below zero, so without its sign"
    return _Found(quantity, channel, why)


def _likely_unit(
    quantity: str,
    values: Array,
    together: NDArray[np.int64] | None,
    joints: Joints,
    motion: _Motion,
    channels: dict[str, ChannelSection],
) -> tuple[str | tuple[str, ...], str]:
    """The unit of a channel that states none, and why; an empty one where none is likely."""
    if quantity in MAY_BE_UNSIGNED:
        return plausible.drive_unit(quantity, values)
    if quantity in ("torque", "torque_command"):
        return _mixed(joints, "N", plausible.torque_unit(values, joints))
    like = channels["position"].unit
    if quantity == "reference_position" and like is not None:
        return like, "as the positions"
    if quantity == "reference_velocity" and together is not None:
        return _mixed(joints, "m/s", _speed_unit(values[together], joints, motion))
    if quantity == "reference_acceleration" and isinstance(like, str):
        return f"{like}/s²", "as the positions"
    return _mixed(joints, next(iter(UNITS[quantity][1])), (next(iter(UNITS[quantity][0])), "by default"))


def _mixed(joints: Joints, slide: str, hinges: tuple[str, str]) -> tuple[str | tuple[str, ...], str]:
    """The hinges' unit, or one a joint where some slide."""
    unit, why = hinges
    if not unit or not any(joints.is_slide) or all(joints.is_slide):
        return unit, why
    return tuple(slide if sliding else unit for sliding in joints.is_slide), why


def _speed_unit(values: Array, joints: Joints, motion: _Motion) -> tuple[str, str]:
    """The unit of velocities (M, n): that of the hinges where there are some."""
    slides = np.asarray(joints.is_slide)
    of = slides if slides.all() else ~slides
    return plausible.velocity_unit(values[:, of], motion.position[:, of], motion.time, bool(slides.all()))


def _velocity(
    names: tuple[str, ...],
    values: Array,
    stated: tuple[str, str] | None,
    joints: Joints,
    motion: _Motion,
    channels: dict[str, ChannelSection],
) -> _Found:
    """Velocities that are the positions' derivative, or references that were called like them."""
    unit, why = _mixed(joints, "m/s", _speed_unit(values, joints, motion))
    if unit:
        return _Found(
            "velocity",
            ChannelSection(columns=names, unit=stated[0] if stated else unit),
            stated[1] if stated else why,
        )
    like = channels["position"]
    factor = factor_of("position", like.unit, joints.is_slide[0]) if isinstance(like.unit, str) else None
    if factor is not None and plausible.is_position_again(values, motion.position, factor):
        channel = _in_columns(like, names)
        return _Found("reference_position", channel, "it follows the positions, not their derivative")
    return _Found("velocity", None, why)


def _in_columns(channel: ChannelSection, names: tuple[str, ...]) -> ChannelSection:
    """A channel of the same unit and zero in other columns."""
    return channel.model_copy(update={"columns": names})
