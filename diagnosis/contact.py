"""A push of the surroundings: short bursts in what is left, which no function of the state explains."""

from collections.abc import Collection

import numpy as np

from .candidates import EVENT, Place, candidates
from .evidence import fitted_to, squares
from .likelihood import INDEPENDENT, Weighed, odds, weigh
from .weighing import Bank, Stage

# Considered where this share of the time, in blocks of so many samples, holds that much of a joint's squared
# residual; named where it explains as much.
BURST_TIME, BURST, BURST_SHARE, SMALLEST_SHARE = 0.1, 20, 0.5, 0.4
# Log-likelihood that a push must add beyond the price of its coefficients.
SMALLEST_GAIN = 7.5
RIVALS = 3


def contact(
    stage: Stage, taken: Collection[Place]
) -> tuple[Weighed, tuple[tuple[Weighed, float], ...]] | None:
    """The link that was pushed, its rivals with their probabilities; None where nothing looks like a push.

    An event cannot be predicted from other runs, so it is judged where it was seen, and pays for its
    coefficients instead (Akaike).
    """
    if not _in_bursts(stage):
        return None
    pushes = candidates(stage.prepared, (), (EVENT,))
    likeliest = sorted(
        (w for w in weigh(stage, Bank(stage.ground, pushes)) if w.candidate.place not in taken),
        key=lambda w: -w.gain.objective,
    )[: RIVALS + 1]
    before = squares(stage.fitted.residual)
    worth, shares = [], []
    for weighed in likeliest:
        _, trial = fitted_to(stage.prepared, [*stage.hypothesis.accepted, weighed.candidate])
        left = squares(trial.residual) / np.maximum(before, 1e-300)
        gained = -0.5 * INDEPENDENT * float(np.sum(stage.counts * np.log(np.maximum(left, 1e-300))))
        worth.append(gained - weighed.candidate.count)
        shares.append(float(np.max(1 - left)))
    if not worth or max(worth) < SMALLEST_GAIN or shares[int(np.argmax(worth))] < SMALLEST_SHARE:
        return None
    order = np.argsort(-np.array(worth), kind="stable")
    probability = odds([worth[i] for i in order])
    rivals = tuple((likeliest[i], float(p)) for i, p in zip(order[1:], probability[1:], strict=True))
    return likeliest[order[0]], rivals


def _in_bursts(stage: Stage) -> bool:
    """Whether a small part of the time holds most of some joint's residual."""
    for joint in range(stage.prepared.joints):
        blocks = [
            float(np.mean(run[first : first + BURST, joint] ** 2))
            for run in stage.fitted.residual
            for first in range(0, len(run) - BURST, BURST)
        ]
        largest = np.sort(blocks)[::-1]
        if largest[: max(round(BURST_TIME * len(blocks)), 1)].sum() > BURST_SHARE * largest.sum():
            return True
    return False
