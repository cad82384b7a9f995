"""Which column has the time stamps, and in which unit."""

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from identification.errors import InputError

from ..mapping import TimeSection
from ..table import UNNAMED, Channel, Numbers, Stream, Table
from ..units import TIME, known_unit
from .names import is_time, parsed

# Hz; robots are logged at such rates, mostly near the middle one.
SLOWEST, USUAL, FASTEST = 5.0, 250.0, 20_000.0
# Seconds since 1970 of the years that recordings are from.
EPOCH = (1.0e9, 2.5e9)
# Nine tenths of the steps of a clock that has no name are no longer than so many times a tenth of them.
EVEN = 1.5
# A clock goes on in this share of the steps, and has so many different stamps.
GOES_ON, FEWEST = 0.95, 3


@dataclass(frozen=True)
class Clock:
    """The time of a table, and why."""

    section: TimeSection
    why: str


def clock_of(table: Table, stream: Stream) -> Clock:
    """The clock of a table by one of its streams. Raises InputError where it has none, or one of no known
    unit.
    """
    channel, why = _column(stream)
    if channel is None:
        expected = "a column of time stamps; without one, say time: {rate: ...} in Hz in a map"
        names = ", ".join(name for each in stream.channels[:8] for name in each.columns()[:1])
        raise InputError(table.path, "time", expected, f"none among {names}")
    name, values = channel.columns()[0], channel.values[:, 0]
    stated = known_unit(channel.unit) or parsed(channel.name).unit
    if stated in TIME:
        return Clock(TimeSection(column=name, unit=stated), f"{why}, in {stated} as stated")
    unit, reason = _unit(values)
    if not unit:
        expected = (
            f"stamps of samples at {SLOWEST:g} to {FASTEST:g} Hz in s, ms, µs or ns; say the unit in a map"
        )
        raise InputError(table.path, name, expected, reason)
    return Clock(TimeSection(column=name, unit=unit), f"{why}, in {unit}: {reason}")


def _column(stream: Stream) -> tuple[Channel | None, str]:
    """The channel of time stamps, or None, and why it is."""
    singles = [each for each in stream.channels if each.values.shape[1] == 1]
    stated = [each for each in singles if each.quantity == "time"]
    for each in stated:
        if _stamps(each.values[:, 0]) >= FEWEST:
            other = "" if each is stated[0] else f", since {stated[0].name} stands still"
            return each, f"{each.name}{other}"
    named = [each for each in singles if is_time(parsed(each.name).words)]
    going = [each for each in named if _stamps(each.values[:, 0]) >= FEWEST]
    if going:
        return max(going, key=lambda each: _stamps(each.values[:, 0])), "by its name"
    if not named and singles and all(each.name.startswith(UNNAMED) for each in stream.channels):
        first = singles[0]
        if _stamps(first.values[:, 0]) == len(first.values):
            return first, "the first column, which increases"
    increasing = [each for each in singles if _is_even(each.values[:, 0])]
    if len(increasing) == 1:
        return increasing[0], "the one column that increases in even steps"
    return None, ""


def _is_even(values: Numbers) -> bool:
    """Whether values (N,) increase throughout in about even steps, and are no row's number."""
    steps = np.diff(values)
    if len(steps) < FEWEST or not np.all(steps > 0) or np.all(steps == 1):
        return False
    return bool(np.quantile(steps, 0.9) < EVEN * np.quantile(steps, 0.1))


def _stamps(values: Numbers) -> int:
    """How many different stamps there are, zero where the values do not go on."""
    known = values[np.isfinite(values)]
    if len(known) < FEWEST or np.mean(np.diff(known) >= 0) < GOES_ON:
        return 0
    return len(np.unique(known))


def _unit(values: Numbers) -> tuple[str, str]:
    """The unit in which stamps (N,) are those of a robot's log, or none, and why."""
    known = values[np.isfinite(values)]
    steps = np.diff(known)
    step, largest = float(np.median(steps[steps > 0])), float(np.max(np.abs(known)))
    rates = {unit: 1 / (step * factor) for unit, factor in TIME.items()}
    possible = {unit: rate for unit, rate in rates.items() if SLOWEST <= rate <= FASTEST}
    since = [unit for unit in possible if EPOCH[0] <= largest * TIME[unit] <= EPOCH[1]]
    if since:
        return since[0], f"counted from 1970, {possible[since[0]]:.4g} Hz"
    if not possible:
        return "", f"a median step of {step:.6g}"
    unit = min(possible, key=lambda unit: abs(math.log(possible[unit] / USUAL)))
    return unit, f"that is {possible[unit]:.4g} Hz"


def time_columns(streams: Iterable[Stream]) -> set[str]:
    """Names, within the recording, of all columns that may be time stamps."""
    return {
        stream.column_name(each.columns()[0])
        for stream in streams
        for each in stream.channels
        if each.quantity == "time" or (each.values.shape[1] == 1 and is_time(parsed(each.name).words))
    }
