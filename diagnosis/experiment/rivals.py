"""Open questions of a diagnosis: effects that its runs cannot distinguish, or would not show."""

from dataclasses import dataclass

from testbench.effects import effects
from testbench.effects.base import Scope

from ..decision.findings import Diagnosis

# A set that is confused is separated pair by pair; effects that would not show need only show, one by one.
MOST_CONFUSED, MOST_HIDDEN = 4, 40


@dataclass(frozen=True)
class Rival:
    """One hypothesis: an effect at a place."""

    effect: str
    joint: int | None
    into: int | None = None


@dataclass(frozen=True)
class Open:
    """Effects that stay open. rivals: at least one. confused: whether to distinguish them from one another.

    Where not, each is to be distinguished from no effect at all.
    """

    rivals: tuple[Rival, ...]
    confused: bool


def still_open(diagnosis: Diagnosis) -> Open | None:
    """The first effect that others are confusable with, and those; else what would not have shown.

    None where nothing stays open: what would not have shown matters only where nothing is named.
    """
    for named in diagnosis.effects:
        if named.confusable_with:
            others = [_rival(diagnosis, name, named.joint) for name in named.confusable_with]
            found = [Rival(named.effect, named.joint, named.into), *(o for o in others if o is not None)]
            return Open(tuple(found[:MOST_CONFUSED]), True) if len(found) > 1 else None
    if diagnosis.effects:
        return None
    hidden = [_rival(diagnosis, name, joint) for name, joint in diagnosis.not_observable]
    seen = tuple(rival for rival in hidden if rival is not None)
    return Open(seen[:MOST_HIDDEN], False) if seen else None


def _rival(diagnosis: Diagnosis, name: str, joint: int | None) -> Rival | None:
    """An effect at this joint as it was weighed, or as its scope has it; None if it cannot be there."""
    weighed = [each for each in diagnosis.ranked if each.effect == name]
    for each in weighed:
        if joint in (each.joint, each.into):
            return Rival(name, each.joint, each.into)
    scope = effects()[name].DESCRIPTION.scope
    if scope is Scope.ROBOT:
        return Rival(name, None)
    if scope is Scope.JOINT and joint is not None:
        return Rival(name, joint)
    return Rival(name, weighed[0].joint, weighed[0].into) if weighed else None
