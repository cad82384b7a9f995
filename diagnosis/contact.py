"""A push of the surroundings: short bursts in what is left, which no function of the state explains."""

from collections.abc import Collection

import numpy as np

from .candidates import EVENT, Place, candidates
from .evidence import fitted_to, squares
from .likelihood import Weighed, odds, weigh
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

    An event cannot be predicted from other runs, so it pays for its coefficients instead (Akaike).
    """
    if not _in_bursts(stage):
        return None
    worth = {}
    for weighed in weigh(stage, Bank(stage.ground, candidates(stage.prepared, (), (EVENT,)))):
        if weighed.candidate.place not in taken:
            worth[weighed.candidate.place] = weighed.gain.objective / 2 - weighed.candidate.count, weighed
    ordered = [weighed for _, weighed in sorted(worth.values(), key=lambda w: -w[0])]
    if not ordered or worth[ordered[0].candidate.place][0] < SMALLEST_GAIN:
        return None
    _, trial = fitted_to(stage.prepared, [*stage.hypothesis.accepted, ordered[0].candidate])
    before, after = squares(stage.fitted.residual), squares(trial.residual)
    if np.max(1 - after / np.maximum(before, 1e-300)) < SMALLEST_SHARE:
        return None
    shortlist = ordered[: RIVALS + 1]
    probability = odds([worth[w.candidate.place][0] for w in shortlist])
    return shortlist[0], tuple((w, float(p)) for w, p in zip(shortlist[1:], probability[1:], strict=True))


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
