"""Search for the effects: hypotheses grown one effect at a time, judged on runs that were left out.

At every stage each family of the catalogue is weighed against the hypothesis so far; the likeliest are
refined and fitted jointly with everything else, and the best is accepted if it is material. An effect
that is material but no larger than on any healthy robot is fitted all the same, so that nothing else has to
imitate it, but it is not reported.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from testbench.effects.base import EffectDescription, Scope

from ..data.run import Prepared
from ..decision.attribution import Attribution
from ..decision.reported_effects import Found, accepted_as
from ..fit.likelihood import Weighed
from ..fit.linearisation import first_linearised
from ..fit.normal_equations import standard_values
from ..fit.score import Stage
from ..held_out.folds import covered, covered_for
from ..model.base_regressor import BaseRegressor
from ..model.candidate import ZERO
from ..model.effect_sizes import with_friction
from ..model.gram import Bank
from ..model.library import Library
from ..proposals.low_speed_friction import NearRest, near_rest, with_friction_near_rest
from ..proposals.saturation import Cut, cuts
from ..proposals.transmission_load import linearised_until_settled
from .conclusion import concluded
from .grown import Banks, Grown, as_of
from .search_round import Search

MOST_EFFECTS, MOST_TERMS = 8, 16
# An encoder offset that the runs are linearised with is accepted among the first effects, if there is one.
FIRST_TAKEN = 4


def attribute(prepared: Prepared, without: Sequence[str] = ()) -> Attribution:
    """Grow the hypothesis from "parameters only" until nothing material is left to explain.

    Where friction turns out not to jump with the speed's sign, all is begun again with what it does; where
    the zero that parameters were taken beside is no effect in the end, without it.
    """
    # What depends on the logs alone stays when all is begun again.
    limits, library = cuts(prepared), Library(without)
    prepared, known, seeks_zero = covered(prepared), NearRest(), ZERO not in without
    while True:
        begun = first_linearised(with_friction_near_rest(prepared, known), seeks_zero)
        grown = _grown(begun, limits, library)
        if isinstance(grown, NearRest):
            known = grown
            continue
        found = None if grown is None else concluded(grown, library)
        if found is None or (begun.zeros.any() and not found.takes_in(*_zero_of(begun))):
            seeks_zero = False
        else:
            return found


def _grown(prepared: Prepared, limits: Sequence[Sequence[Cut]], library: Library) -> Grown | NearRest | None:
    """The hypothesis grown on these runs, or else newly found friction near rest.

    None where the encoder offset that the runs are linearised with is a tilt's or the like. limits: of
    ``cuts``.
    """
    grown, search = _begun(prepared, limits, library)
    zero = _zero_of(prepared) if prepared.zeros.any() else None
    if zero and _is_of_another(zero, grown.weighed):
        return None
    while len(grown.accepted) < MOST_TERMS and sum(a.named for a in grown.accepted) < MOST_EFFECTS:
        banks = grown.banks
        assert banks is not None
        more = near_rest(grown.stage, grown.weighed, banks.ahead, banks.soft)
        if more is not None:
            return more
        found = search.round(grown.stage, grown.weighed, banks.free)
        del banks
        if found is None:
            break
        firsts = [*(a.candidate.place[:2] for a in grown.accepted), found.best.candidate.place[:2]]
        if zero and len(firsts) >= FIRST_TAKEN and zero not in firsts:
            return None
        if found.best.candidate.description.relinearised:
            # Columns along the runs as they were linearised before are of no use, and large.
            grown = replace(grown, banks=None, weighed=())
        grown = _with(grown, found, search, library)
    return grown


def _begun(prepared: Prepared, limits: Sequence[Sequence[Cut]], library: Library) -> tuple[Grown, Search]:
    """The hypothesis of re-identification alone, and what every round searches in. limits: of ``cuts``."""
    library.along(prepared)
    original = Stage.of(BaseRegressor(prepared), [])
    proposals = Bank(original.base, library.catalogue)
    if (covered := covered_for(original, proposals)) is not prepared:
        prepared, original = covered, Stage.of(BaseRegressor(covered), [])
        proposals = Bank(original.base, proposals.candidates)
    sized = with_friction(prepared.robot, standard_values(prepared, original.fitted.values))
    search = Search(original.fitted, sized, limits, tuple(library.without))
    banks = Banks.beside(proposals, original.base, library.motions)
    weighed = tuple(search.open(original, proposals))
    return Grown(original, sized, original, (), weighed, banks), search


def _with(grown: Grown, found: Found, search: Search, library: Library) -> Grown:
    """The hypothesis with one more effect; without its banks, these are made anew."""
    hypothesis, fitted = found.trial
    banks, base = grown.banks, grown.stage.base
    if banks is None:
        hypothesis, fitted = linearised_until_settled(grown.sized, hypothesis, fitted)
        base = hypothesis.base
        library.along(hypothesis.prepared)
        banks = Banks.beside(Bank(base, library.catalogue), base, library.motions)
    stage = Stage(hypothesis, fitted)
    weighed = search.open(stage, banks.proposals)
    own = accepted_as(found, grown.stage, grown.sized)
    accepted = as_of(hypothesis, [*grown.accepted, own])
    return replace(grown, stage=stage, accepted=tuple(accepted), weighed=tuple(weighed), banks=banks)


def _zero_of(prepared: Prepared) -> tuple[str, int]:
    """Effect and joint of the encoder offset that the runs are linearised with."""
    return ZERO, int(np.argmax(np.abs(prepared.zeros)))


def _is_of_another(zero: tuple[str, int], weighed: Sequence[Weighed]) -> bool:
    """Whether an effect that resembles an encoder offset gains more than the offset. weighed: best first."""
    places = [w.candidate.place[:2] for w in weighed]
    ahead = weighed[: places.index(zero)] if zero in places else weighed
    return any(_is_like_a_zero(w.candidate.description) for w in ahead)


def _is_like_a_zero(description: EffectDescription) -> bool:
    """Whether an effect moves the loads of several joints, or a joint against its encoder, as a zero does."""
    return description.of_transmission or (description.scope is Scope.ROBOT and not description.late)
