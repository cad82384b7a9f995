"""Samples that a log has lost on the way: held by a late packet, spoiled by a bad one, or never filled in.

A reader that misses a packet writes the last one again, a bit that flips throws one sample far off, and one
that is stopped leaves its last records empty. Differentiated twice, each is larger than all that an arm does.
Held and spoiled ones stand alone between good neighbours, empty ones at an end.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d

from .log import REQUIRED, Recording, with_channels
from .sampling import SMOOTH, interpolated
from .time_stamps import off_cubic

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

# So many samples in a row can be lost: what is longer is a rest, or a gap that time stamps should show.
MOST_LOST = 5
# A spoiled sample is so many times farther from the cubic through its neighbours than samples near it are ...
FARTHER, NEAR = 10.0, 50
# ... and farther than this share of all that the joint moves, or of the torque's middle nine tenths.
SHARE_OF_RANGE, SHARE_OF_TORQUE = 1e-4, 1.0
# ... and than so many steps of the encoder, and this share of what the joint moves there in one sample.
STEPS, SHARE_OF_MOTION = 8.0, 0.5
# A held sample is followed by a step of more than so many counts of an encoder.
COUNTS = 2.0
# Positions, or torques, come from a slower bus where this share of all samples repeats.
OF_A_SLOWER_BUS = 0.2
# Good samples to either side that a lost one is interpolated from.
NEIGHBOURS = 4


def lost_samples(recording: Recording) -> Mask:
    """Which samples (N,) of a recording are not what was measured then, but for what a slower bus repeats."""
    recording = _refreshed(recording)
    return _held(recording) | _spoiled(recording)


def mended(recording: Recording, lost: Mask) -> Recording:
    """The recording with these samples (N,) as their neighbours have them, positions by a cubic.

    So are positions, or torques, that a slower bus repeats.
    """
    recording = _refreshed(recording)
    if not lost.any():
        return recording
    time = recording.time
    return with_channels(recording, time, lambda field, own: _filled(time, own, lost, field in SMOOTH))


def _refreshed(recording: Recording) -> Recording:
    """The recording with what a slower bus repeats of positions, or of torques, between what it brings."""
    position, torque = (_between(recording, field) for field in REQUIRED)
    return replace(recording, position=position, torque=torque)


def _between(recording: Recording, field: str) -> Array:
    """A channel (N, n) with what a slower bus repeats interpolated; as it is where none does."""
    values: Array = getattr(recording, field)
    repeated = held_by_a_bus(values)
    if not repeated.any():
        return values
    return _filled(recording.time, values, repeated, field in SMOOTH)


def held_by_a_bus(values: Array) -> Mask:
    """Samples of a channel (N, n) that repeat what a slower bus brought; none where few repeat."""
    repeated = _repeated(values)
    return repeated if np.mean(repeated) >= OF_A_SLOWER_BUS else np.zeros(len(values), bool)


def _repeated(values: Array) -> Mask:
    """Samples of (N, n) that are those before again, and from which some joint steps on by a few counts."""
    again = np.zeros(len(values), bool)
    again[1:] = np.all(values[1:] == values[:-1], axis=1)
    counts = COUNTS * np.array([_step(column) for column in values.T])
    # Where values are held, the step after is the next sample that is not.
    fresh = np.flatnonzero(~again)
    steps_on = np.append(np.any(np.abs(np.diff(values[fresh], axis=0)) > counts, axis=1), False)
    return again & steps_on[np.cumsum(~again) - 1]


def _held(recording: Recording) -> Mask:
    """Samples that are the one before again, in all that is measured."""
    again = np.zeros(len(recording.time), bool)
    rows = np.concatenate([getattr(recording, field) for field in REQUIRED], axis=1)
    again[1:] = np.all(rows[1:] == rows[:-1], axis=1)
    has_torque = recording.torque.any()
    step = np.array([_step(position) for position in recording.position.T])
    for first, last in _stretches(again):
        # Where torque is not known a joint that hardly moves repeats its counts as well.
        moved = recording.position[min(last, len(again) - 1)] - recording.position[first - 1]
        if last - first > MOST_LOST or not (has_torque or np.any(np.abs(moved) > COUNTS * step)):
            again[first:last] = False
    return again


def _spoiled(recording: Recording) -> Mask:
    """Empty samples, and those far from the cubic that their neighbours are else on."""
    positions = recording.position.T
    least = [_least(position) for position in positions]
    empty = np.any([_empty(*each) for each in zip(positions, least, strict=True)], axis=0)
    found, filled = empty.copy(), ~empty
    time = recording.time[filled]
    for position, least_off in zip(positions, least, strict=True):
        found[filled] |= _alone(time, position[filled], least_off)
    for torque in recording.torque[filled].T:
        low, high = np.quantile(torque, (0.05, 0.95))
        found[filled] |= _alone(time, torque, SHARE_OF_TORQUE * float(high - low))
    return found


def _least(position: Array) -> float:
    """How far a spoiled sample of these (N,) is off at least: of their range, or in steps of the encoder."""
    return max(SHARE_OF_RANGE * float(np.ptp(position)), STEPS * _step(position))


def _step(position: Array) -> float:
    """The smallest step of these (N,); 0 for none."""
    steps = np.abs(np.diff(position))
    step = float(np.min(steps, where=steps > 0, initial=np.inf))
    return step if np.isfinite(step) else 0.0


def _alone(time: Array, values: Array, least: float) -> Mask:
    """Samples of (N,), up to MOST_LOST in a row, that are far from where good ones beside them put them.

    time: (N,) s. least: how far at least, in the values' unit.
    """
    found = np.zeros(len(values), bool)
    off = off_cubic(time, values)
    moved = SHARE_OF_MOTION * maximum_filter1d(np.abs(np.gradient(values)), 2 * NEIGHBOURS + 1)
    limit = np.max([FARTHER * _usual(off), moved, np.full(len(values), least)], axis=0)
    for first, last in _stretches(off > limit, 2):
        near = slice(max(first - NEIGHBOURS, 0), min(last + NEIGHBOURS, len(values)))
        here, bad = values[near].copy(), np.zeros(near.stop - near.start, bool)
        for _ in range(MOST_LOST):
            left = np.where(bad, 0.0, off_cubic(time[near], here))
            if np.all(left <= limit[near]):
                found[near] |= bad
                break
            bad[np.argmax(left)] = True
            here = _filled(time[near], values[near, None], bad, is_smooth=True)[:, 0]
    return found


def _empty(position: Array, least: float) -> Mask:
    """Samples of (N,) at either end, up to MOST_LOST, beyond a step that no motion makes. least: as above."""
    found = np.zeros(len(position), bool)
    if len(position) <= MOST_LOST + NEIGHBOURS:
        return found
    for order in (1, -1):
        end, steps = found[::order], np.abs(np.diff(position[::order][: MOST_LOST + NEIGHBOURS + 1]))
        for count in range(1, MOST_LOST + 1):
            if steps[count - 1] > max(FARTHER * float(steps[count : count + NEIGHBOURS].max()), least):
                end[:count] = True
    return found


def _usual(off: Array) -> Array:
    """Medians of NEAR samples and those before and after them, the largest, at each of (N,)."""
    count = max(len(off) // NEAR, 1)
    size = len(off) // count
    blocks = np.median(off[: count * size].reshape(count, size), axis=1)
    around = np.pad(blocks, 1, mode="edge")
    largest = np.max([around[:-2], blocks, around[2:]], axis=0)
    return largest[np.minimum(np.arange(len(off)) // size, count - 1)]


def _filled(time: Array, values: Array, lost: Mask, is_smooth: bool) -> Array:
    """Values (N, n) with the lost ones interpolated; by a curve where enough others are left for one."""
    good, out = ~lost, values.copy()
    is_curve = is_smooth and int(np.count_nonzero(good)) > 3
    out[lost] = interpolated(time[good], values[good], time[lost], is_curve)
    return out


def _stretches(flags: Mask, apart: int = 1) -> list[tuple[int, int]]:
    """First and one after the last of flags (N,) that are no farther apart than this."""
    places = np.flatnonzero(flags)
    if not len(places):
        return []
    parts = np.split(places, np.flatnonzero(np.diff(places) > apart) + 1)
    return [(int(part[0]), int(part[-1]) + 1) for part in parts]
