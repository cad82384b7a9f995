"""A round of the search: the effect that explains most of what a hypothesis leaves."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, partial

import numpy as np

from testbench.robot import Robot

from ..decision.reported_effects import Found
from ..fit.likelihood import Weighed, weigh
from ..fit.normal_equations import Fit
from ..fit.score import Gain, Stage
from ..model.candidate import PUSH, SATURATION
from ..model.effect_sizes import is_plausible
from ..model.gram import Bank
from ..plausibility.materiality import is_material
from ..proposals.contact import contact, explains_all_bursts, is_in_bursts_at_several
from ..proposals.ripple_peaks import RIPPLE, ripple_candidates
from ..proposals.saturation import Cut, saturation
from .shortlist import choose

# An effect that all runs together fit as zero, by this Wald statistic, is none, whatever parts predict.
AS_NOTHING = 1.0
# A push that explains so many times what any effect does is seen first: it would be taken for effects.
FAR_MORE = 3.0
# A limit that gains less than this share of what a push at its joint does is none.
AS_MUCH = 0.7
# With this share of another joint's squared residual an effect is what acts there, and no limit.
NEARLY_ALL = 0.9


@dataclass(frozen=True)
class Search:
    """Inputs of the search that stay the same from round to round.

    first: re-identification, without effects, fitted. sized: the robot that sizes are relative to. limits: of
    ``cuts``. without: effects taken out of the catalogue.
    """

    first: Fit
    sized: Robot
    limits: Sequence[Sequence[Cut]]
    without: tuple[str, ...]

    def open(self, stage: Stage, proposals: Bank) -> list[Weighed]:
        """Candidates that may still be accepted, best first."""
        taken = {each.place for each in stage.hypothesis.accepted}

        def allowed(gain: Gain) -> bool:
            if gain.coefficients[0] < gain.candidate.description.least_coefficient:
                return False
            # What is held at a bound above zero is another shape's.
            lower = gain.candidate.member.lower
            if np.any((lower > 0) & (gain.coefficients <= lower)):
                return False
            # A law beside an effect's first stands back for it where it is none that is met.
            law = gain.candidate.member.law
            return law is None or is_plausible(self.sized, gain.candidate, gain.coefficients)

        peaks = (
            () if RIPPLE in self.without else ripple_candidates(self.first, stage.hypothesis, stage.fitted)
        )
        anew = Bank(stage.base, peaks)
        return [
            w
            for w in weigh(stage, proposals, anew, allowed=allowed)
            if w.candidate.place not in taken
            and w.gain.wald > AS_NOTHING
            and is_plausible(self.sized, w.candidate, w.gain.coefficients)
        ]

    def round(self, stage: Stage, weighed: Sequence[Weighed], free: Bank) -> Found | None:
        """The likeliest effect: a material one or a limit, else a push.

        weighed: of ``open``. free: candidates of generic.py.
        """
        # It takes longer than all else: searched for where it may matter, and once.
        push = cache(partial(self.push, stage, free))
        material = [w for w in weighed if is_material(self.sized, stage, w)]
        clipped = None if SATURATION in self.without else saturation(stage, free, self.limits)
        limit = 0.0 if clipped is None else clipped.score
        largest = max((w.score for w in material), default=0.0)
        if (
            is_in_bursts_at_several(stage)
            and (pushed := push()) is not None
            and pushed.best.score > FAR_MORE * max(largest, limit)
            and explains_all_bursts(stage, pushed.trial[1])
        ):
            return pushed
        if clipped is not None and limit > largest:
            shared = [w for w in material if _is_seen_elsewhere(stage, w.gain, clipped)]
            if shared and (chosen := choose(self.sized, stage, shared, weighed, self.without)) is not None:
                return Found(*chosen)
            # Who withstands a push asks for torque as long as it lasts.
            if (pushed := push()) is not None and _is_likelier_there(pushed.best, clipped):
                return pushed
            return Found(clipped, (), stage.with_effects([clipped.candidate]))
        if material and (chosen := choose(self.sized, stage, material, weighed, self.without)) is not None:
            return Found(*chosen)
        return push()

    def push(self, stage: Stage, free: Bank) -> Found | None:
        """A push of the surroundings, the only one."""
        if PUSH in self.without or any(each.is_event for each in stage.hypothesis.accepted):
            return None
        found = contact(stage, free)
        return None if found is None else Found(*found)


def _is_seen_elsewhere(stage: Stage, gain: Gain, limit: Weighed) -> bool:
    """Whether an effect on a limit's joint also explains nearly all of another joint's residual.

    Fitted without it, a limit takes up what it does at its joint, and leaves it contradicted there.
    """
    joint, rows = limit.candidate.family.joint, list(gain.candidate.member.rows)
    elsewhere = [row for row in rows if row != joint]
    return joint in rows and bool(np.any(stage.shares(gain)[elsewhere] > NEARLY_ALL))


def _is_likelier_there(one: Weighed, other: Weighed) -> bool:
    """Whether both are at the same joint, and the other explains no more than a part of what the one does."""
    return one.candidate.family.joint == other.candidate.family.joint and other.score < AS_MUCH * one.score
