"""Effects of the shortlist at their best shapes, each by the law that is likeliest there."""

from collections.abc import Sequence

import numpy as np

from testbench.effects import effect
from testbench.effects.cable_spring import DESCRIPTION, HARDENING
from testbench.effects.signature import Family, Member
from testbench.robot import Robot

from ..fit.delay import likeliest_delay
from ..fit.likelihood import SURELY, Weighed, gained, likeliest_of, log_likelihood, log_posterior, price
from ..fit.score import Stage
from ..fit.shape_search import search, searched_for
from ..model.candidate import DELAY
from ..model.candidates import candidate
from ..model.effect_sizes import is_plausible, quantities
from .ripple_peaks import RIPPLE, second_waves

CABLE = DESCRIPTION.name
# First step of a refinement, as a share of the shape's range, and how many shapes are tried; where several go
# together, more of an accepted effect.
STEP, TRIED, MORE_TRIED = 0.12, 14, 50


def late_alone(robot: Robot, stage: Stage, shortlist: Sequence[Weighed]) -> list[Weighed]:
    """Delays of one joint only, of those whose drives may lag: slow motion hardly distinguishes the two."""
    # Of a robot of one joint every delay is common, and where one is known the rest is a drive's.
    if stage.prepared.joints == 1 or any(each.is_common_delay for each in stage.hypothesis.accepted):
        return []
    logged = [run.logged for run in stage.prepared.runs]
    lags = [each.candidate.family for each in shortlist if each.candidate.description.is_lag]
    families = [effect(DELAY).signature(logged, lag.joint, None) for lag in lags]
    return [late for each in families for late in _best_of(robot, stage, each, each.members)]


def by_its_law(robot: Robot, stage: Stage, found: Weighed) -> Weighed:
    """The refined effect by its likeliest law.

    Far from its best shape, an effect of another law may seem the likelier: where that happens, each law is
    refined first.
    """
    family, law = found.candidate.family, found.candidate.member.law
    if family.effect == CABLE:
        return _cable(robot, stage, found)
    if not found.candidate.description.laws_apart:
        return found if family.richer is None else _richer(robot, stage, found)
    tried, members = [found], family.members
    if family.richer is not None:
        members += family.richer(found.candidate.member)
    for other in dict.fromkeys(each.law for each in members if each.law != law):
        own = [each for each in members if each.law == other]
        tried += _best_of(robot, stage, family, own, MORE_TRIED)
    if len(tried) == 1:
        return found
    # As far as the others.
    tried[0] = refined(robot, stage, found, MORE_TRIED)
    return max(tried, key=lambda each: log_likelihood(*stage.compared(each.candidate)))


def _cable(robot: Robot, stage: Stage, found: Weighed) -> Weighed:
    """A cable that hardens where all runs clearly favour it over its best other law, else the latter."""
    family, hardens = found.candidate.family, found.candidate.member.law == HARDENING
    others = [each for each in family.members if each.law != HARDENING]
    lines = _best_of(robot, stage, family, others) if hardens else [found]
    if not lines:
        return found
    (line,) = lines
    members = [each for each in family.members if each.law == HARDENING]
    hoses = [found] if hardens else _best_of(robot, stage, family, members)
    hose = max([*hoses, *_hardly_hardening(robot, stage, line)], key=lambda each: each.score, default=line)
    if hose.score <= line.score or _favoured_by(stage, hose, line) < 0:
        return line
    # Where it rests has several likeliest places.
    starts = [each for member in members for each in likeliest_of(stage, family, [member])]
    hose = max([hose, *(refined(robot, stage, each) for each in starts)], key=lambda each: each.score)
    return _surely(stage, refined(robot, stage, hose, MORE_TRIED), line)


def _hardly_hardening(robot: Robot, stage: Stage, line: Weighed) -> list[Weighed]:
    """The cable that hardens least, from the linear one's rest position, refined, where it is likelier."""
    family = line.candidate.family
    assert family.member is not None
    rest = quantities(line.candidate, line.gain.coefficients)["rest"].value
    within = float(np.clip(rest, *family.refine["rest"]))
    hose = family.member({"rest": within, "doubling": family.refine["doubling"][1]})
    likeliest = likeliest_of(stage, family, [hose])
    return [refined(robot, stage, each, MORE_TRIED) for each in likeliest if each.score > line.score]


def _richer(robot: Robot, stage: Stage, found: Weighed) -> Weighed:
    """The effect by a richer law that includes its own where all runs clearly favour it, else as refined."""
    family = found.candidate.family
    assert family.richer is not None
    members = family.richer(found.candidate.member)
    if family.effect == RIPPLE:
        members += second_waves(*stage.compared(found.candidate))
    laws = dict.fromkeys(each.law for each in members)
    of_laws = ([each for each in members if each.law == law] for law in laws)
    likeliest = [each for own in of_laws for each in likeliest_of(stage, family, own)]
    met = [each for each in likeliest if is_plausible(robot, each.candidate, each.gain.coefficients)]
    tried = [refined(robot, stage, each, TRIED * len(searched_for(each.candidate))) for each in met]
    return _surely(stage, max(tried, key=lambda each: each.score), found) if tried else found


def _surely(stage: Stage, other: Weighed, plain: Weighed) -> Weighed:
    """An effect by another law where all runs together clearly favour it over the plain one; else that.

    Left-out runs do not decide: bent parameters predict them by chance.
    """
    return other if _favoured_by(stage, other, plain) > SURELY else plain


def _favoured_by(stage: Stage, other: Weighed, plain: Weighed) -> float:
    """Log-posterior of all runs together by which another law of an effect is likelier than the plain one."""
    simple, richer = (
        log_posterior(*stage.with_effects([each.candidate])) - price(stage.hypothesis, each.candidate)
        for each in (plain, other)
    )
    return richer - simple


def _best_of(
    robot: Robot, stage: Stage, family: Family, members: Sequence[Member], tried: int = TRIED
) -> list[Weighed]:
    """The best of some of a family's members, refined; nothing where none of them shows."""
    return [refined(robot, stage, each, tried) for each in likeliest_of(stage, family, members)]


def refined(robot: Robot, stage: Stage, weighed: Weighed, tried: int = TRIED) -> Weighed:
    """The family's best member at any shape near this one, if it is one that is met.

    robot: that sizes are relative to. tried: so many shapes.
    """
    prepared, family = stage.prepared, weighed.candidate.family
    if family.member is None or not searched_for(weighed.candidate):
        return weighed
    if weighed.candidate.is_common_delay:
        # Beside the log's timing any size seems to do; its column is exact at its own alone.
        delay, _ = likeliest_delay(stage.hypothesis, stage.fitted)
        gain = stage.gain(candidate(prepared, family, family.member({"difference": delay})))
        return weighed if gain is None else Weighed(gain, gained(stage, gain))
    best = weighed

    def negative(shaped: Member) -> float:
        nonlocal best
        gain = stage.gain(candidate(prepared, family, shaped))
        if gain is None:
            return 0.0
        score = gained(stage, gain)
        if score > best.score and is_plausible(robot, gain.candidate, gain.coefficients):
            best = Weighed(gain, score)
        return -score

    search(weighed.candidate, np.full(len(searched_for(weighed.candidate)), STEP), tried, negative)
    return best
