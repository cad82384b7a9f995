"""Removal of effects with which left-out runs are predicted far worse than without: not identifiable here."""

from dataclasses import replace

import numpy as np

from ..fit.normal_equations import Fit, fitted_to, on_whole_runs, squares
from ..model.hypothesis import Design
from ..plausibility.accepted import Accepted, without_one
from .attribution import Attribution

# A joint's left-out gap with the effects is so many times what it is without any, far more than right effects
# ever make it, even those that only one run shows.
FAR_WORSE = 10.0


def without_misleading(
    found: Attribution, parameters_only: tuple[Design, Fit]
) -> tuple[Attribution, tuple[Design, Fit]]:
    """The attribution without such effects, and its fit with whole runs left out.

    parameters_only: re-identification with whole runs left out. A push is of its own run and predicts none.
    """
    left = squares(parameters_only[1].held_out)
    final = found.hypothesis, on_whole_runs(found.hypothesis, found.fitted)
    while True:
        worse = squares(final[1].held_out) / np.maximum(left, 1e-300)
        joint = int(np.argmax(worse))
        loading = [place for place, item in enumerate(found.accepted) if _loads(item, joint)]
        if worse[joint] < FAR_WORSE**2 or not loading:
            return found, final
        trials = [_without(found, place) for place in loading]
        found, final = min(trials, key=lambda trial: float(squares(trial[1][1].held_out)[joint]))


def without_undetermined(found: Attribution) -> Attribution:
    """The attribution without effects that these runs determine too badly to predict another motion.

    Those that are not reported, at joints that move too little for it: a few seconds of one motion suit any
    law. At joints that only ever move by themselves all of those, and those that re-identified parameters
    absorb: what other joints' motion loads them with was never seen.
    """
    by_itself = found.prepared.by_itself
    enough = found.hypothesis.has_enough_samples & ~by_itself
    together = np.any(found.prepared.moved.any(axis=0) & ~by_itself)

    def is_determined(item: Accepted) -> bool:
        joint = item.candidate.family.joint
        if joint is None:
            return bool(together) or not item.candidate.family.swallowed
        if enough[joint]:
            return True
        return item.named and not (item.candidate.family.swallowed and by_itself[joint])

    kept = [item for item in found.accepted if is_determined(item)]
    if len(kept) == len(found.accepted):
        return found
    hypothesis, fitted = fitted_to(found.hypothesis.base, [item.candidate for item in kept])
    return replace(found, accepted=tuple(kept), hypothesis=hypothesis, fitted=fitted)


def _without(found: Attribution, place: int) -> tuple[Attribution, tuple[Design, Fit]]:
    """The attribution without one of its effects, and its fit with whole runs left out."""
    hypothesis, fitted = without_one(found.hypothesis.base, found.accepted, place)
    rest = found.accepted[:place] + found.accepted[place + 1 :]
    without = replace(found, accepted=rest, hypothesis=hypothesis, fitted=fitted)
    return without, (hypothesis, on_whole_runs(hypothesis, fitted))


def _loads(item: Accepted, joint: int) -> bool:
    return joint in item.candidate.member.rows and not item.candidate.is_event
