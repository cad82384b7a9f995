"""A drive that reports the torque it gave: its limit leaves nothing to explain, but a flat top.

Along the measured motion such a robot has no gap. What shows the limit is that the torque stays at one level
while gravity and friction go on changing, again and again, and is never beyond; or that more was commanded.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import minimum_filter1d

from identification.inverse_dynamics import inverse_dynamics
from testbench.effects import effect
from testbench.effects.logged import Logged

from ..data.run import DEAD_ZONE, Prepared
from ..model.candidate import SATURATION, Candidate
from ..model.candidates import candidate

Array = NDArray[np.float64]

# A top is so many standard deviations of the noise to either side, and no less than this share of its level.
DEVIATIONS, SMALLEST_WIDTH = 4.0, 0.0075
# Share that may be beyond the level by chance; and, of what is short of its command, not at the level.
ELSEWHERE = 0.05
# A smooth peak has 2.4 times as many samples within its top as in what is as wide below it, and a plateau of
# a slow sweep or of a constant acceleration may have any.
FLAT, FEWEST, TIMES = 6.0, 15, 3
# Seconds without clipping that part one time at the limit from the next.
APART = 0.1
# A limit that the model has is no gap.
OF_LIMIT = 0.97


@dataclass(frozen=True)
class _Top:
    """Where a joint's torque is highest. level, width: N·m. inside: a flat run's samples (N,)."""

    level: float
    width: float
    inside: list[NDArray[np.bool_]]


def flat_tops(prepared: Prepared, known: Sequence[int | None]) -> list[Candidate]:
    """A limit of each joint whose reported torque has a flat top; known: joints that have one already."""
    logged = [run.logged for run in prepared.runs]
    step = prepared.torque_step
    limits = {j: _limit(logged, j, float(step[j])) for j in range(prepared.joints) if j not in known}
    return [_reported(prepared, joint, limit) for joint, limit in limits.items() if limit is not None]


def _limit(runs: Sequence[Logged], joint: int, step: float) -> float | None:
    """N·m, or None where nothing is cut off, or by a limit that the model has. step: N·m, of the log."""
    if all(run.torque_command is not None for run in runs):
        level = _cut_off(runs, joint, step)
    else:
        top = _top([run.tau[:, joint] for run in runs], step)
        level = top.level if top is not None and _is_held_back(runs, joint, top) else None
    return level if level is not None and level <= OF_LIMIT * runs[0].limits.torque[joint] else None


def _cut_off(runs: Sequence[Logged], joint: int, step: float) -> float | None:
    """The level that torque stays at wherever far more was asked for; None where there is none."""
    torque = [run.tau[:, joint] for run in runs]
    size, asked = np.abs(np.concatenate(torque)), np.concatenate([_asked(run, joint) for run in runs])
    width = max(DEVIATIONS * _noise(torque), SMALLEST_WIDTH * float(size.max()), step)
    short = asked - size > TIMES * width
    if np.sum(short) < FEWEST:
        return None
    level = float(np.median(size[short]))
    at_level = np.mean(np.abs(size[short] - level) <= width)
    beyond = np.sum(size > level + width)
    return level if at_level > 1 - ELSEWHERE and beyond <= ELSEWHERE * np.sum(short) else None


def _asked(run: Logged, joint: int) -> Array:
    """Smallest torque command within a sample of each, (N,) N·m, in the direction of the logged torque."""
    assert run.torque_command is not None
    command = np.sign(run.tau[:, joint]) * run.torque_command[:, joint]
    return minimum_filter1d(command, 3)


def _noise(torque: Sequence[Array]) -> float:
    """Its standard deviation, N·m: the median of second differences leaves out steps."""
    differences = np.concatenate([np.diff(each, 2) for each in torque])
    return float(np.median(np.abs(differences)) / 0.6745 / np.sqrt(6))


def _top(torque: Sequence[Array], step: float) -> _Top | None:
    """The level that is passed by chance only, if some run is far more often there than just below."""
    size = [np.abs(each) for each in torque]
    pooled = np.sort(np.concatenate(size))
    if len(pooled) < FEWEST or pooled[-1] == 0:
        return None
    highest = float(pooled[-FEWEST])
    width = max(DEVIATIONS * _noise(torque), SMALLEST_WIDTH * highest, step)
    level = float(np.median(pooled[np.abs(pooled - highest) < 2 * width]))
    inside = [np.abs(each - level) <= width for each in size]
    below = [np.abs(each - level + 2 * width) < width for each in size]
    flat = [i.sum() >= FEWEST and i.sum() > FLAT * b.sum() for i, b in zip(inside, below, strict=True)]
    beyond = float(np.sum(pooled > level + width))
    if not any(flat) or beyond > ELSEWHERE * sum(float(i.sum()) for i in inside):
        return None
    if level <= width:
        return None
    # What only passes the level, or rests there once, is none of it.
    return _Top(level, width, [i & is_flat for i, is_flat in zip(inside, flat, strict=True)])


def _bouts(time: Array) -> int:
    """How many times it is there."""
    return int(len(time) > 0) + int(np.sum(np.diff(time) > APART))


def _is_held_back(runs: Sequence[Logged], joint: int, top: _Top) -> bool:
    """Whether torque repeatedly stays at the level while the model's torque without acceleration varies."""
    bouts = sum(_bouts(run.time[inside]) for run, inside in zip(runs, top.inside, strict=True))
    if bouts < TIMES:
        return False
    still = []
    for run, inside in zip(runs, top.inside, strict=True):
        # At rest friction has any size and sign.
        there = inside & (np.abs(run.dq[:, joint]) > DEAD_ZONE)
        q, dq = run.q[there], run.dq[there]
        torque = inverse_dynamics(run.chain, run.parameters, q, dq, np.zeros_like(q))
        still.append(np.sign(run.tau[there, joint]) * torque[:, joint])
    held = np.concatenate(still)
    return len(held) >= FEWEST and bool(np.std(held) > top.width)


def _reported(prepared: Prepared, joint: int, limit: float) -> Candidate:
    """The limit as an effect of which these runs' torque has nothing: what it cut off was never reported."""
    family = effect(SATURATION).signature([run.logged for run in prepared.runs], joint, None)
    assert family.member is not None
    member = family.member({"limit": limit})
    nothing = tuple(np.zeros_like(columns) for columns in member.columns)
    return candidate(prepared, family, replace(member, columns=nothing))
