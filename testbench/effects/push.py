"""A push along a log: when it was, how it rose and fell, and the torques that it loads the joints with."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import uniform_filter1d

from .link_force import base_in_link, push_point, wrench_torques
from .logged import Logged

Array = NDArray[np.float64]

# What is pushed with. A force with a couple, which makes it one at any point: turning with the link, or fixed
# in space. A torque of the joint alone. A force at the end of the link, fixed in space. And with a couple or
# without, fixed in space from where the link's axes are as it starts.
KINDS = range(6)
LINK_FORCE, WORLD_FORCE, JOINT_TORQUE, WORLD_FORCE_AT_END, KEPT_FORCE, KEPT_FORCE_AT_END = KINDS
AT_END, KEPT = (WORLD_FORCE_AT_END, KEPT_FORCE_AT_END), (KEPT_FORCE, KEPT_FORCE_AT_END)
# How much longer than between its half heights a push is: one with flanks, and a bell (half a sine).
ABRUPT, BELL = 1.0, 1.5
# Names in the shape of a push that every run has alike, s: when it began and ended, between half heights.
TIMES = ("first", "last")

# The force rises and falls over this time, s.
RAMP = 0.1
# A push's window: smoothed over so long, s, the residual is so many times its usual size, which is taken to
# be no less than this share of its largest.
SMOOTHING, THRESHOLD, QUIETEST = 0.1, 4.0, 0.05
SHORTEST, GAP = 0.05, 0.15
# What covers more of a run than this is no event, but one may stand out higher; the strongest so many windows
# a run are taken.
LARGEST_SHARE, HIGHER, WINDOWS = 0.35, 1.5, 3


def windows(run: Logged, joints: Sequence[int]) -> list[tuple[int, int]]:
    """First and last sample of each window, in time's order: where any of these joints stands out.

    They are between half heights.
    """
    width = max(int(SMOOTHING * run.sample_rate), 1)
    smooth = uniform_filter1d(run.residual[:, joints], width, axis=0)
    size = np.abs(smooth - np.median(smooth, axis=0))
    usual = np.maximum(np.median(size, axis=0) / 0.6745, QUIETEST * size.max(axis=0))
    level = (size / np.maximum(usual, np.finfo(float).tiny)).max(axis=1)
    threshold = THRESHOLD
    found = _merged(level > threshold, run.sample_rate)
    while sum(last - first for first, last in found) > LARGEST_SHARE * run.samples:
        threshold *= HIGHER
        found = _merged(level > threshold, run.sample_rate)
    found.sort(key=lambda window: -float(np.sum(level[window[0] : window[1]] ** 2)))
    halved = np.zeros(run.samples, dtype=bool)
    for first, last in found[:WINDOWS]:
        halved[slice(*_between_half_heights(level, first, last))] = True
    return _stretches(halved)


def _between_half_heights(level: Array, first: int, last: int) -> tuple[int, int]:
    """The window of what stands out highest in a stretch, which may end above half its height."""
    high = level > 0.5 * level[first:last].max()
    inside = np.flatnonzero(high[first:last])
    low = np.flatnonzero(~high)
    before, after = low[low < first + inside[0]], low[low > first + inside[-1]]
    return int(before[-1]) + 1 if len(before) else 0, int(after[0]) if len(after) else len(level)


def _merged(stands_out: NDArray[np.bool_], sample_rate: float) -> list[list[int]]:
    """First and last sample of stretches that are long enough, with short gaps closed."""
    found: list[list[int]] = []
    for first, last in _stretches(stands_out):
        if found and first - found[-1][1] < GAP * sample_rate:
            found[-1][1] = last
        else:
            found.append([first, last])
    return [window for window in found if window[1] - window[0] >= SHORTEST * sample_rate]


def common_times(runs: Sequence[Logged], columns: Sequence[Array]) -> list[tuple[float, float]]:
    """Start and end, s from the start of a run, of the pushes that every run has at the same time.

    columns: of pushes, a run (N, r, k), zero before and after each. Empty for a single run.
    """
    times = _times(runs, columns)
    if len(times) < 2:
        return []
    found = []
    for span in times[0]:
        alike = [[other for other in own if other[0] < span[1] and span[0] < other[1]] for own in times]
        if all(alike):
            first, last = np.median([own[0] for own in alike], axis=0).tolist()
            found.append((first, last))
    return found


def begin_with_runs(runs: Sequence[Logged], columns: Sequence[Array]) -> bool:
    """Whether all pushes are there as their runs begin. columns: as of ``common_times``."""
    return all(first < SHORTEST for own in _times(runs, columns) for first, _ in own)


def _times(runs: Sequence[Logged], columns: Sequence[Array]) -> list[list[tuple[float, float]]]:
    """Start and end, s from the start of its run, of each push; a run each, as of ``common_times``."""
    return [
        [
            (first / run.sample_rate, last / run.sample_rate)
            for first, last in _stretches(own.any(axis=(1, 2)))
        ]
        for run, own in zip(runs, columns, strict=True)
    ]


def _stretches(where: ArrayLike) -> list[tuple[int, int]]:
    """First sample, and the one after the last, of each stretch that is true."""
    edges = np.flatnonzero(np.diff(np.r_[0, np.asarray(where, dtype=np.int8), 0]))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))


def widened(run: Logged, window: tuple[int, int], stretch: float) -> slice:
    """The samples of a push, from its window between half heights."""
    first, last = window
    # A flank's half height is in its middle, a bell's a sixth of its length from the end.
    longer = 0.5 * (last - first) if stretch == BELL else RAMP * run.sample_rate
    more = int(0.5 * longer)
    return slice(max(first - more, 0), min(last + more, run.samples))


def narrowed(first: float, last: float, stretch: float) -> tuple[float, float]:
    """Between half heights, s, from the start and end of a push: the inverse of ``widened``."""
    flank = (last - first) / 6 if stretch == BELL else RAMP / 2
    return first + flank, last - flank


def push_torques_of(run: Logged, joint: int, part: slice, kind: int, stretch: float) -> Array:
    """Torques (M, r, k) N·m on the joints up to the link by unit loads, each in two profiles of time.

    r is one where the load is a torque of the joint alone.
    """
    unit = _unit_torques(run, joint, part, kind)
    profiles = _profiles(part.stop - part.start, RAMP * run.sample_rate, stretch)
    return np.concatenate([unit * profile[:, None, None] for profile in profiles], axis=2)


def _unit_torques(run: Logged, joint: int, part: slice, kind: int) -> Array:
    """J' of unit forces and couples on the link, (M, r, 6 or 3); (M, 1, 1) of a joint torque."""
    q = run.q[part]
    if kind == JOINT_TORQUE:
        return np.ones((len(q), 1, 1))
    unit = wrench_torques(run.chain, q, joint)
    if kind == LINK_FORCE:
        return unit
    axes = base_in_link(run.chain, q, joint)
    if kind in KEPT:
        axes = axes @ axes[0].T
    if kind in AT_END:
        x, y, z = push_point(run.chain, joint)[0]
        couple = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        return (unit[:, :, :3] + unit[:, :, 3:] @ couple) @ axes
    return np.concatenate([unit[:, :, :3] @ axes, unit[:, :, 3:] @ axes], axis=2)


def _profiles(samples: int, ramp: float, stretch: float) -> Array:
    """A bell or a trapezoid with flanks of ``ramp`` samples, and the same leaning: (2, samples)."""
    place = (np.arange(samples) + 0.5) / samples
    if stretch == BELL:
        return np.stack([np.sin(np.pi * place), np.sin(2 * np.pi * place)])
    flank = np.minimum(np.minimum(place, 1 - place) * samples / ramp, 1.0)
    trapezoid = 0.5 - 0.5 * np.cos(np.pi * flank)
    return np.stack([trapezoid, trapezoid * (1 - 2 * place)])
