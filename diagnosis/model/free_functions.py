"""Structure that no named effect claims: what a smooth function of the motion would explain.

Each family is a set of functions of one joint's own position, velocity, direction and time, free of
any law. Where such a set predicts runs that were left out and no effect of the catalogue does as
well, the cause is unknown, and the family says in which regime it shows.
"""

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from testbench.effects.logged import Logged

from ..data.preparation import Prepared
from .candidates import FREE, Candidate, without_law

Array = NDArray[np.float64]

TORQUE, RUN_TIME = "torque", "run time"
REGIMES = (
    "position",
    "velocity",
    "position and direction",
    "acceleration",
    TORQUE,
    RUN_TIME,
    "neighbour's motion",
)

# Pieces that the range of positions and the length of the runs are divided into.
POSITIONS, SPANS = 9, 6
# Of the largest torque: where what turns with its sign does so.
TURNING = (0.02, 0.1)


def generic_candidates(prepared: Prepared, known: Sequence[Candidate] = ()) -> list[Candidate]:
    """One candidate a joint and regime.

    known: those of the same motion by another friction, of which what it does not change is taken.
    """
    logged, same = [run.logged for run in prepared.runs], {each.place: each for each in known}
    found = []
    for joint in range(prepared.joints):
        for regime in REGIMES:
            name = f"{FREE}{regime}"
            if regime != TORQUE and (name, joint, None) in same:
                found.append(same[name, joint, None])
                continue
            columns = [_columns(run, joint, regime, logged) for run in logged]
            k = columns[0].shape[1]
            if k == 0:
                continue
            found.append(without_law(prepared, name, joint, columns, np.full(k, -np.inf), {}))
    return found


def _columns(run: Logged, joint: int, regime: str, runs: Sequence[Logged]) -> Array:
    """Functions of the motion (N, k), each of unit size or so."""
    q, v, a = run.q[:, joint], run.dq[:, joint], run.ddq[:, joint]
    s = v / _largest(r.dq[:, joint] for r in runs)
    if regime == "position":
        return _bumps(q, [r.q[:, joint] for r in runs], POSITIONS)
    if regime == "position and direction":
        return _bumps(q, [r.q[:, joint] for r in runs], POSITIONS) * np.sign(v)[:, None]
    if regime == "velocity":
        near_rest = [np.sign(v) * np.exp(-np.abs(s) / width) for width in (0.02, 0.08, 0.3)]
        return np.column_stack([*near_rest, s * np.abs(s), s**3, np.abs(s)])
    if regime == "acceleration":
        b = a / _largest(r.ddq[:, joint] for r in runs)
        jerk = np.gradient(b) * run.sample_rate / np.pi
        friction = [np.sign(v) * f for f in (np.abs(b), b**2, np.minimum(np.abs(b), 0.2))]
        return np.column_stack([b * np.abs(b), jerk, *friction])
    if regime == TORQUE:
        # By the model: what was measured has the noise of what is looked for.
        t = run.predicted[:, joint] / _largest(r.predicted[:, joint] for r in runs)
        turning = [np.tanh(t / width) for width in TURNING]
        return np.column_stack([*turning, t * np.abs(t), t**3, np.sign(v) * t**2])
    if regime == RUN_TIME:
        spans = _bumps(run.time - run.time[0], [r.time - r.time[0] for r in runs], SPANS)
        return np.column_stack([spans, spans * np.sign(v)[:, None], spans[:, 1:] * s[:, None]])
    found = []
    for k in (int(run.chain.parent[joint]), *run.chain.children(joint)):
        if k >= 0:
            w = run.dq[:, k] / _largest(r.dq[:, k] for r in runs)
            found += [w, np.sign(w), w * np.abs(w), w**2, np.sign(v) * np.abs(w)]
            found += [s * w, s**2 * w, s * w**2]
    return np.column_stack(found) if found else np.zeros((run.samples, 0))


def _largest(series: Iterable[Array]) -> float:
    """Largest absolute value of all runs."""
    return max(max(float(np.max(np.abs(values))) for values in series), 1e-6)


def _bumps(values: Array, runs: Sequence[Array], count: int) -> Array:
    """Hat functions (N, count) that share out the range of all runs and add up to one."""
    low, high = min(float(r.min()) for r in runs), max(float(r.max()) for r in runs)
    place = (values - low) / max(high - low, 1e-9) * (count - 1)
    return np.maximum(1 - np.abs(place[:, None] - np.arange(count)), 0)
