"""Structure that no named effect claims: what a smooth function of the motion would explain.

Each family is a set of functions of one joint's own position, velocity, direction and time, free of
any law. Where such a set predicts runs that were left out and no effect of the catalogue does as
well, the cause is unknown, and the family says in which regime it shows.
"""

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from testbench.effects.columns import ColumnsByInstant, ColumnsByRun, on_one_joint
from testbench.effects.logged import Logged

from ..data.run import Prepared
from .candidate import FREE, Candidate
from .candidates import without_law

Array = NDArray[np.float64]

POSITION, VELOCITY, POSITION_AND_DIRECTION = "position", "velocity", "position and direction"
ACCELERATION, TORQUE, RUN_TIME, NEIGHBOUR = "acceleration", "torque", "run time", "neighbour's motion"
REGIMES = (POSITION, VELOCITY, POSITION_AND_DIRECTION, ACCELERATION, TORQUE, RUN_TIME, NEIGHBOUR)

# Pieces that the range of positions and the length of the runs are divided into.
POSITIONS, SPANS = 9, 6
# Of the largest torque: where what turns with its sign does so.
TURNING = (0.02, 0.1)


def generic_candidates(prepared: Prepared, known: Sequence[Candidate] = ()) -> list[Candidate]:
    """One candidate a joint and regime.

    known: those of the same motion by another model, which changes those of torque alone.
    """
    logged, same = [run.logged for run in prepared.runs], {each.place: each for each in known}
    found = []
    for joint in range(prepared.joints):
        for regime in REGIMES:
            name = f"{FREE}{regime}"
            if regime != TORQUE and (name, joint, None) in same:
                found.append(same[name, joint, None])
                continue
            # Two samples determine how many there are.
            k = _functions([run.part(slice(0, 2)) for run in logged], joint, regime)[0].shape[2]
            if k > 0:
                columns = _functions(logged, joint, regime)
                found.append(without_law(prepared, name, joint, columns, np.full(k, -np.inf), {}))
    return found


def _functions(runs: Sequence[Logged], joint: int, regime: str) -> ColumnsByRun:
    """Functions of the motion, a run (N, 1, k), each of unit size or so."""
    if regime == TORQUE:
        torque = _largest(run.predicted[:, joint] for run in runs)
        return on_one_joint(runs, lambda run: _of_torque(run, joint, torque))
    if regime == ACCELERATION:
        acceleration = _largest(run.ddq[:, joint] for run in runs)
        return on_one_joint(runs, lambda run: _of_acceleration(run, joint, acceleration))
    speeds = [_largest(run.dq[:, each] for run in runs) for each in range(runs[0].joints)]
    if regime == RUN_TIME:
        runs = [replace(run, time=run.time - run.time[0]) for run in runs]
        seconds = _ends(run.time for run in runs)
        return ColumnsByInstant(runs, lambda run: _of_time(run, joint, seconds, speeds)[:, None])
    if regime == VELOCITY:
        return ColumnsByInstant(runs, lambda run: _of_velocity(run, joint, speeds)[:, None])
    if regime == NEIGHBOUR:
        return ColumnsByInstant(runs, lambda run: _of_neighbours(run, joint, speeds)[:, None])
    turns, ends = regime == POSITION_AND_DIRECTION, _ends(run.q[:, joint] for run in runs)
    return ColumnsByInstant(runs, lambda run: _of_position(run, joint, ends, turns)[:, None])


def _of_position(run: Logged, joint: int, ends: tuple[float, float], turns: bool) -> Array:
    bumps = _bumps(run.q[:, joint], ends, POSITIONS)
    return bumps * np.sign(run.dq[:, joint])[:, None] if turns else bumps


def _of_velocity(run: Logged, joint: int, speeds: Sequence[float]) -> Array:
    v = run.dq[:, joint]
    s = v / speeds[joint]
    near_rest = [np.sign(v) * np.exp(-np.abs(s) / width) for width in (0.02, 0.08, 0.3)]
    return np.column_stack([*near_rest, s * np.abs(s), s**3, np.abs(s)])


def _of_acceleration(run: Logged, joint: int, largest: float) -> Array:
    b, sign = run.ddq[:, joint] / largest, np.sign(run.dq[:, joint])
    jerk = np.gradient(b) * run.sample_rate / np.pi
    friction = [sign * f for f in (np.abs(b), b**2, np.minimum(np.abs(b), 0.2))]
    return np.column_stack([b * np.abs(b), jerk, *friction])


def _of_torque(run: Logged, joint: int, largest: float) -> Array:
    # By the model: what was measured has the noise of what is looked for.
    t = run.predicted[:, joint] / largest
    turning = [np.tanh(t / width) for width in TURNING]
    return np.column_stack([*turning, t * np.abs(t), t**3, np.sign(run.dq[:, joint]) * t**2])


def _of_time(run: Logged, joint: int, ends: tuple[float, float], speeds: Sequence[float]) -> Array:
    v, spans = run.dq[:, joint], _bumps(run.time, ends, SPANS)
    return np.column_stack([spans, spans * np.sign(v)[:, None], spans[:, 1:] * (v / speeds[joint])[:, None]])


def _of_neighbours(run: Logged, joint: int, speeds: Sequence[float]) -> Array:
    v, found = run.dq[:, joint], []
    s = v / speeds[joint]
    for k in (int(run.chain.parent[joint]), *run.chain.children(joint)):
        if k >= 0:
            w = run.dq[:, k] / speeds[k]
            found += [w, np.sign(w), w * np.abs(w), w**2, np.sign(v) * np.abs(w)]
            found += [s * w, s**2 * w, s * w**2]
    return np.column_stack(found) if found else np.zeros((run.samples, 0))


def _largest(series: Iterable[Array]) -> float:
    """Largest absolute value of all runs."""
    return max(max(float(np.max(np.abs(values))) for values in series), 1e-6)


def _ends(series: Iterable[Array]) -> tuple[float, float]:
    """Smallest and largest value of all runs."""
    low, high = zip(*((float(values.min()), float(values.max())) for values in series), strict=True)
    return min(low), max(high)


def _bumps(values: Array, ends: tuple[float, float], count: int) -> Array:
    """Hat functions (N, count) that share out a range and add up to one."""
    low, high = ends
    place = (values - low) / max(high - low, 1e-9) * (count - 1)
    return np.maximum(1 - np.abs(place[:, None] - np.arange(count)), 0)
