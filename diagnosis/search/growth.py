"""Search for the effects: hypotheses grown one effect at a time, judged on runs that were left out.

At every stage each family of the catalogue is weighed against the hypothesis so far; the likeliest are
refined and fitted jointly with everything else, and the best is accepted if it is material. An effect
that is material but no larger than on any healthy robot is fitted all the same, so that nothing else has to
imitate it, but it is not reported.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from testbench.robot import Robot

from ..data.preparation import Prepared
from ..decision.attribution import Attribution
from ..decision.reported_effects import (
    accepted_as,
    as_fitted_at_last,
    judged_again,
    likely_faults,
    told_apart_at_last,
)
from ..fit.likeliest_shapes import after_a_step, at_likeliest_shapes
from ..fit.likelihood import Weighed, gained, weigh
from ..fit.linearisation import PAYLOAD, RELINEARISED, TRANSMISSIONS, first_linearised
from ..fit.normal_equations import Fit, fitted_to, standard_values
from ..fit.score import Stage
from ..held_out.folds import covered, covered_for
from ..model.base_regressor import Ground, ground
from ..model.candidates import SATURATION, Candidate
from ..model.effect_sizes import OFFSET, with_friction
from ..model.gram import Bank
from ..model.hypothesis import Design
from ..model.library import Sought
from ..plausibility.accepted import (
    Accepted,
    laws_of_position,
    out_of_bounds,
    resonances,
    without_one,
    without_rests,
)
from ..plausibility.materiality import is_material
from ..plausibility.observability import not_observable
from ..proposals.flat_top import flat_tops
from ..proposals.low_speed_friction import (
    NearRest,
    lead_candidates,
    near_rest,
    soft_candidates,
    with_friction_near_rest,
)
from ..proposals.one_sided_springs import one_sided
from ..proposals.saturation import Cut, cuts
from ..proposals.transmission_load import linearised_until_settled
from ..proposals.vibration import vibrations, with_its_line, without_shaken, worth_telling
from ..residual.unexplained import NOTHING, unclaimed, with_its_period, without_imperfections
from .search_round import Search

Array = NDArray[np.float64]

MOST_EFFECTS, MOST_TERMS = 8, 16
# What moves the loads of several joints, or a joint against its encoder, as a zero that lies elsewhere does.
LIKE_ZEROS = ("base_tilt", PAYLOAD, *TRANSMISSIONS)
# An encoder offset that the runs are linearised with is accepted among the first effects, if there is one.
FIRST_TAKEN = 4
# A rival this probable cannot be distinguished on these runs.
CONFUSABLE = 0.1


def attribute(prepared: Prepared, without: Sequence[str] = ()) -> Attribution:
    """Grow the hypothesis from "parameters only" until nothing material is left to explain.

    Where friction turns out not to jump with the speed's sign, all is begun again with what it does; where
    the zero that parameters were taken beside is no effect in the end, without it.
    """
    # What depends on the logs alone stays when all is begun again.
    limits, sought = cuts(prepared), Sought(without)
    prepared, known, seeks_zero = covered(prepared), NearRest(), OFFSET not in without
    while True:
        begun = first_linearised(with_friction_near_rest(prepared, known), seeks_zero)
        grown = _grown(begun, limits, sought)
        if isinstance(grown, NearRest):
            known = grown
        elif grown is None or (begun.zeros.any() and not grown.takes_in(*_zero_of(begun))):
            seeks_zero = False
        else:
            return grown


def _grown(
    prepared: Prepared, limits: Sequence[Sequence[Cut]], sought: Sought
) -> Attribution | NearRest | None:
    """The hypothesis grown on these runs, or else newly found friction near rest.

    None where the encoder offset that the runs are linearised with is a tilt's or the like. limits: of
    ``cuts``.
    """
    sought.along(prepared)
    original = Stage.of(ground(prepared), [])
    proposals = Bank(original.ground, sought.catalogue)
    if (foretold := covered_for(original, proposals)) is not prepared:
        prepared, original = foretold, Stage.of(ground(foretold), [])
        proposals = Bank(original.ground, proposals.candidates)
    base = original.ground
    first = hypothesis, fitted = original.hypothesis, original.fitted
    sized = with_friction(prepared.robot, standard_values(prepared, fitted.values))
    free, ahead, soft = _other_banks(base, sought.motions)
    search = Search(original, sized, limits, tuple(sought.without))
    # What an effect of the whole robot explains at a joint has nothing to do with the joint's own.
    stage = apart = original
    weighed = search.open(stage, proposals)
    if prepared.zeros.any() and _is_of_another(prepared, weighed):
        return None
    accepted: list[Accepted] = []
    zero = _zero_of(prepared) if prepared.zeros.any() else None
    # With the effects accepted after it fitted, a push is seen more clearly.
    resought = False
    while len(accepted) < MOST_TERMS and sum(a.named for a in accepted) < MOST_EFFECTS:
        if (more := near_rest(sized, stage, weighed, ahead, soft, sought.catalogue)) is not None:
            return more
        found = search.round(stage, weighed, free)
        if found is None and not resought and (place := _of_event(accepted)) < len(accepted) - 1:
            resought, rest = True, [a for k, a in enumerate(accepted) if k != place]
            alone = Stage(base, *without_one(base.prepared, accepted, place))
            found = search.push(alone, free)
            if found is not None:
                accepted, stage = rest, alone
        if found is None:
            break
        before, taken_in = stage, found.best.candidate.family
        firsts = [*_places(accepted), found.best.candidate.place[:2]]
        if zero and len(firsts) >= FIRST_TAKEN and zero not in firsts:
            return None
        hypothesis, fitted = found.trial
        if taken_in.effect in RELINEARISED:
            hypothesis, fitted = linearised_until_settled(sized, hypothesis, fitted)
            prepared = hypothesis.prepared
            base = ground(prepared)
            del proposals, free, ahead, soft, weighed
            sought.along(prepared)
            proposals = Bank(base, sought.catalogue)
            free, ahead, soft = _other_banks(base, sought.motions)
        stage = Stage(base, hypothesis, fitted)
        weighed = search.open(stage, proposals)
        accepted.append(accepted_as(found, before, apart, sized, accepted, weighed))
        accepted = _as_of(hypothesis, accepted)
        if found.best.candidate.is_event:
            accepted = judged_again(base, sized, accepted, weighed)
        if taken_in.joint is None:
            apart = stage
        if found.is_last:
            break
    accepted, hypothesis, fitted = _pruned(base, sized, accepted, hypothesis, fitted)
    if len(kept := without_rests(accepted)) < len(accepted):
        # What was shaped beside a rest of its own is not as it is alone.
        refitted = fitted_to(base.prepared, [a.candidate for a in kept])
        hypothesis, fitted = at_likeliest_shapes(sized, *refitted)
        accepted = _as_of(hypothesis, kept)
    if SATURATION not in sought.without:
        accepted, hypothesis, fitted = _with_flat_tops(accepted, hypothesis, fitted)
    last = stage if hypothesis is stage.hypothesis else Stage(base, hypothesis, fitted)
    taken = {item.candidate.place for item in accepted}
    open_ = [w for w in weigh(last, proposals) if w.candidate.place not in taken]
    final = last.hypothesis, last.fitted
    accepted = likely_faults(sized, *final, accepted, open_)
    accepted = likely_faults(sized, *final, told_apart_at_last(last, sized, accepted, weighed), open_)
    certain = [a.candidate for a in accepted if a.is_certain]
    sure = None if len(certain) == len(accepted) else Stage.of(base, certain)
    imitations = (laws_of_position, one_sided, resonances, vibrations)
    imitated = [each for kind in imitations for each in kind(original, last, accepted)]
    if len(kept := without_shaken(accepted, imitated)) < len(accepted):
        accepted = kept
        hypothesis, fitted = fitted_to(base.prepared, [a.candidate for a in accepted])
    hidden = not_observable(sized, open_)
    hypothesis, fitted = at_likeliest_shapes(sized, hypothesis, fitted)
    named = [place for place, item in enumerate(accepted) if item.named]
    hypothesis, fitted = after_a_step(sized, hypothesis, fitted, named)
    accepted = as_fitted_at_last(sized, hypothesis, fitted, accepted)
    accepted = likely_faults(sized, hypothesis, fitted, accepted, open_)
    unmet = out_of_bounds(sized, hypothesis, fitted, accepted)
    nothing = without_imperfections(sized, original, last, unclaimed(original, last, free, sure), open_)
    misfits = [with_its_period(last, with_its_line(last, each)) for each in nothing]
    # What is like something says more than that nothing was.
    alike = {each.joint for each in imitated}
    misfits = [each for each in misfits if each.regime != NOTHING or each.joint not in alike]
    unknown = (*misfits, *worth_telling(imitated), *unmet)
    open_at = {each.joint for each in unknown}
    accepted = [replace(a, named=a.named and a.candidate.family.joint not in open_at) for a in accepted]
    return Attribution(prepared, tuple(accepted), hypothesis, fitted, first, unknown, tuple(weighed), hidden)


def _as_of(hypothesis: Design, accepted: Sequence[Accepted]) -> list[Accepted]:
    """The accepted effects, each with the hypothesis' own candidate in place of its own."""
    return [replace(a, candidate=c) for a, c in zip(accepted, hypothesis.accepted, strict=True)]


def _places(accepted: Sequence[Accepted]) -> list[tuple[str, int | None]]:
    """Effect and joint of each accepted effect."""
    return [item.candidate.place[:2] for item in accepted]


def _zero_of(prepared: Prepared) -> tuple[str, int]:
    """Effect and joint of the encoder offset that the runs are linearised with."""
    return OFFSET, int(np.argmax(np.abs(prepared.zeros)))


def _is_of_another(prepared: Prepared, weighed: Sequence[Weighed]) -> bool:
    """Whether an effect that resembles an encoder offset gains more than the offset. weighed: best first."""
    places = [w.candidate.place[:2] for w in weighed]
    ahead = places[: places.index(_zero_of(prepared))] if _zero_of(prepared) in places else places
    return any(name in LIKE_ZEROS for name, _ in ahead)


def _other_banks(base: Ground, motions: Sequence[Candidate]) -> tuple[Bank, Bank, Bank]:
    """Banks besides the catalogue: free functions of motion, friction ahead of the joint, smooth friction."""
    sought = motions, lead_candidates(base.prepared), soft_candidates(base.prepared)
    free, ahead, soft = (Bank(base, each) for each in sought)
    return free, ahead, soft


def _of_event(accepted: Sequence[Accepted]) -> int:
    """Index of a push among the accepted effects; their number where there is none."""
    return next((place for place, a in enumerate(accepted) if a.candidate.is_event), len(accepted))


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
    """Take out, one by one, effects that are no longer material with the others fitted."""
    while len(accepted) > 1:
        rest = [without_one(base.prepared, accepted, place) for place in range(len(accepted))]
        worth = []
        for item, trial in zip(accepted, rest, strict=True):
            stage = Stage(base, *trial)
            gain = stage.gain(item.candidate)
            if gain is not None:
                # Both are fitted in full here, so what leaving it out costs is known exactly.
                gain = stage.as_fitted(gain, (hypothesis, fitted))
            # The timing of the log makes up for all that a delay explains.
            is_late = item.named and item.candidate.is_common_delay
            kept = item.candidate.is_event or item.is_trace or is_late
            # An effect that was best when it was accepted is judged as such.
            weighed = None if gain is None else Weighed(gain, gained(stage, gain))
            keeps = kept or (weighed is not None and is_material(sized, stage, weighed, is_best=True))
            worth.append((keeps, 0.0 if weighed is None else weighed.score))
        weakest = min(range(len(worth)), key=lambda k: (worth[k][0], worth[k][1]))
        if worth[weakest][0]:
            break
        accepted = [a for k, a in enumerate(accepted) if k != weakest]
        hypothesis, fitted = rest[weakest]
    return accepted, hypothesis, fitted
