"""Which effect it is: hypotheses grown one effect at a time, judged on runs that were left out.

At every stage each family of the catalogue is weighed against the hypothesis so far; the likeliest are
refined and fitted jointly with everything else, and the best is taken in if it is material. What is
material but no larger than on any healthy robot is fitted all the same, so that nothing else has to
imitate it, but it is not named.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from testbench.robot import Robot

from .accepted import Accepted, laws_of_position
from .candidates import EVENT, SATURATION, candidates
from .evidence import Design, Fit, fitted_to, squares, standard_values
from .flat_top import flat_tops
from .generic import generic_candidates
from .ground import Ground, ground
from .likelihood import Weighed, gained, weigh
from .linearisation import RELINEARISED, first_linearised, linearised_anew
from .materiality import is_beyond_healthy, is_main, is_material, is_obvious, with_friction
from .observability import not_observable
from .preparation import Prepared
from .round import Found, Search
from .saturation import cuts
from .unclaimed import Unclaimed, unclaimed
from .weighing import Bank, Stage

Array = NDArray[np.float64]

MOST_EFFECTS, MOST_TERMS = 6, 16
# A rival this probable cannot be told apart on these runs.
CONFUSABLE = 0.1
# Beside what no effect explains, one that takes off this share of it may be a trace of the same.
DWARFED = 0.02


@dataclass(frozen=True)
class Attribution:
    """The hypothesis found.

    unknown: structure that no effect explains. last_stage: what was not taken in. hidden: effects that would
    not show in these runs.
    """

    prepared: Prepared
    accepted: tuple[Accepted, ...]
    hypothesis: Design
    fitted: Fit
    parameters_only: tuple[Design, Fit]
    unknown: tuple[Unclaimed, ...]
    last_stage: tuple[Weighed, ...]
    hidden: tuple[tuple[str, int | None], ...]


def attribute(prepared: Prepared, without: Sequence[str] = ()) -> Attribution:
    """Grow the hypothesis from "parameters only" until nothing material is left to explain."""
    prepared = first_linearised(prepared)
    hypothesis, fitted = fitted_to(prepared, [])
    first = hypothesis, fitted
    sized = with_friction(prepared.robot, standard_values(prepared, fitted.values))
    # A limit and a push of the surroundings are sought in ways of their own.
    early = [*without, SATURATION, EVENT]
    base = ground(prepared)
    proposals, free = (Bank(base, c) for c in (candidates(prepared, early), generic_candidates(prepared)))
    original = Stage(base, hypothesis, fitted)
    search = Search(original, sized, cuts(prepared), tuple(without))
    # What an effect of the whole robot explains at a joint has nothing to do with the joint's own.
    stage = apart = original
    weighed = search.open(stage, proposals)
    accepted: list[Accepted] = []
    while len(accepted) < MOST_TERMS and sum(a.named for a in accepted) < MOST_EFFECTS:
        found = search.round(stage, weighed, free)
        if found is None:
            break
        before, taken_in = stage, found.best.candidate.family
        hypothesis, fitted = found.trial
        if taken_in.effect in RELINEARISED:
            hypothesis, fitted = linearised_anew(hypothesis, fitted)
            prepared = hypothesis.prepared
            base = ground(prepared)
            proposals = Bank(base, candidates(prepared, early))
            free = Bank(base, generic_candidates(prepared))
        stage = Stage(base, hypothesis, fitted)
        weighed = search.open(stage, proposals)
        accepted.append(_accepted(found, before, apart, sized, accepted, weighed))
        accepted = [replace(a, candidate=c) for a, c in zip(accepted, hypothesis.accepted, strict=True)]
        if found.best.candidate.is_event:
            accepted = _judged_again(base, sized, accepted, weighed)
        if taken_in.joint is None:
            apart = stage
        if found.is_trace:
            # It was sought last; beside it, any other trace is a rest of it.
            break
    accepted, hypothesis, fitted = _pruned(base, sized, accepted, hypothesis, fitted)
    if SATURATION not in without:
        accepted, hypothesis, fitted = _with_flat_tops(accepted, hypothesis, fitted)
    last = stage if hypothesis is stage.hypothesis else Stage(base, hypothesis, fitted)
    certain = [a.candidate for a in accepted if a.is_certain]
    sure = None if len(certain) == len(accepted) else Stage(base, *fitted_to(base.prepared, certain))
    unknown = (*unclaimed(original, last, free, sure), *laws_of_position(original, last, accepted))
    taken = {item.candidate.place for item in accepted}
    open_ = [w for w in weigh(last, proposals) if w.candidate.place not in taken]
    hidden = not_observable(sized, base.torque_rms, open_)
    accepted = [replace(a, named=a.named and not _is_dwarfed(a, unknown, last)) for a in accepted]
    return Attribution(prepared, tuple(accepted), hypothesis, fitted, first, unknown, tuple(weighed), hidden)


def _is_dwarfed(item: Accepted, unknown: Sequence[Unclaimed], last: Stage) -> bool:
    """Whether what no effect explains is at its joint, which a name would only imitate, or far larger."""
    misfit = [each.joint for each in unknown]
    left = last.held_squares / np.maximum(last.counts, 1) / last.ground.torque_rms**2
    largest = float(np.max(left[misfit], initial=0.0))
    return item.candidate.family.joint in misfit or item.worth < DWARFED * largest


def _accepted(
    found: Found,
    stage: Stage,
    apart: Stage,
    sized: Robot,
    before: Sequence[Accepted],
    rest: Sequence[Weighed],
) -> Accepted:
    """What a round has found, and whether it has a name.

    apart: the stage before any effect of the joints. rest: what is left to explain beside it.
    """
    best, torque_rms = found.best, stage.ground.torque_rms
    # Where an imperfection of healthy size would explain it as well, nothing else need be there.
    sizes = [
        (best.candidate, found.trial[1].values[-best.candidate.count :]),
        *((w.candidate, w.gain.coefficients) for w, p in found.rivals if p > CONFUSABLE),
    ]
    beyond = is_obvious(stage, best.gain) or all(is_beyond_healthy(sized, torque_rms, *s) for s in sizes)
    # What a push leaves is where it was.
    somewhere = {a.candidate.family.joint for a in before if a.named and not a.candidate.is_event}
    main = is_main(sized, apart, stage, best, somewhere, rest)
    certain = found.is_certain(stage)
    taken_off = np.maximum(stage.held_squares - squares(found.trial[1].held_out), 0)
    return Accepted(
        candidate=best.candidate,
        probability=1.0 - sum(p for _, p in found.rivals),
        rivals=found.rivals,
        score=best.score,
        share=float(stage.shares(best.gain).max()),
        worth=float(np.sum(taken_off / np.maximum(stage.counts, 1) / torque_rms**2)),
        named=beyond and main and certain,
        is_certain=certain,
        is_trace=found.is_trace,
    )


def _judged_again(
    base: Ground, sized: Robot, accepted: Sequence[Accepted], rest: Sequence[Weighed]
) -> list[Accepted]:
    """What was taken in before a push, judged beside it: a push hides how much anything else explains.

    The push is the last one; limits are judged where they are sought. rest: as of ``_accepted``.
    """
    robots = [a.candidate for a in accepted if a.candidate.is_event or a.candidate.family.joint is None]
    apart = Stage(base, *fitted_to(base.prepared, robots))
    found = list(accepted)
    for place, item in enumerate(accepted[:-1]):
        if item.candidate.family.effect == SATURATION:
            continue
        others = [*found[:place], *found[place + 1 :]]
        stage = Stage(base, *_without(base, found, place))
        gain = stage.gain(item.candidate)
        if gain is not None:
            trial = stage.with_effects([item.candidate])
            gain = stage.as_fitted(gain, trial)
            best = Weighed(gain, gained(stage, gain))
            found[place] = _accepted(Found(best, item.rivals, trial), stage, apart, sized, others, rest)
    return found


def _without(base: Ground, accepted: Sequence[Accepted], place: int) -> tuple[Design, Fit]:
    """The hypothesis without one of its effects, fitted in full."""
    return fitted_to(base.prepared, [a.candidate for k, a in enumerate(accepted) if k != place])


def _with_flat_tops(
    accepted: Sequence[Accepted], hypothesis: Design, fitted: Fit
) -> tuple[list[Accepted], Design, Fit]:
    """The hypothesis with the limits of drives that report what they gave, which explain nothing here."""
    known = [a.candidate.family.joint for a in accepted if a.candidate.family.effect == SATURATION]
    found = flat_tops(hypothesis.prepared, known)
    if not found:
        return list(accepted), hypothesis, fitted
    trial = fitted_to(hypothesis.prepared, [*hypothesis.accepted, *found])
    seen = [Accepted(each, probability=1.0, rivals=(), score=0.0, share=0.0, worth=0.0) for each in found]
    return [*accepted, *seen], *trial


def _pruned(
    base: Ground, sized: Robot, accepted: list[Accepted], hypothesis: Design, fitted: Fit
) -> tuple[list[Accepted], Design, Fit]:
    """Take out, one by one, what is no longer material beside the others."""
    while len(accepted) > 1:
        rest = [_without(base, accepted, place) for place in range(len(accepted))]
        worth = []
        for item, trial in zip(accepted, rest, strict=True):
            stage = Stage(base, *trial)
            gain = stage.gain(item.candidate)
            if gain is not None:
                # Both are fitted in full here, so what leaving it out costs is known exactly.
                gain = stage.as_fitted(gain, (hypothesis, fitted))
            kept = item.candidate.is_event or item.is_trace
            # What was best when it was taken in is judged as such.
            weighed = None if gain is None else Weighed(gain, gained(stage, gain))
            keeps = kept or (weighed is not None and is_material(sized, stage, weighed, is_best=True))
            worth.append((keeps, 0.0 if weighed is None else weighed.score))
        weakest = min(range(len(worth)), key=lambda k: (worth[k][0], worth[k][1]))
        if worth[weakest][0]:
            break
        accepted = [a for k, a in enumerate(accepted) if k != weakest]
        hypothesis, fitted = rest[weakest]
    return accepted, hypothesis, fitted
