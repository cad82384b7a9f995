"""The shortlist of a round: its effects at their best shapes, fitted in full, the likeliest, its rivals."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from testbench.effects import effect
from testbench.effects.cable_spring import HARDENING
from testbench.effects.signature import Family, Member
from testbench.robot import Robot

from .bank import Bank
from .candidates import DELAY, Candidate, candidate
from .delay import likeliest_delay
from .evidence import Fit
from .healthy import BRISTLES, CABLE, ELASTIC, LAG, RIPPLE, SPRINGS, is_plausible, quantities
from .hypothesis import Design
from .likeliest_shapes import at_likeliest_shape, is_searched
from .likelihood import Weighed, gained, likeliest_of, log_likelihood, log_posterior, odds, price
from .linearisation import TRANSMISSIONS, bends_parameters, linearised_anew
from .materiality import OF_ENCODER
from .ripple_peaks import second_waves
from .shape_search import search, searched_for
from .weighing import Stage

Array = NDArray[np.float64]

SHORTLIST = 4
# What keeps less than this share of its log-likelihood once another effect is in explains the same thing.
RIVAL_LEFT = 0.5
# Log-likelihood by which a joint may seem less likely than another for what bends all parameters.
AS_LIKELY = 25.0
# The coefficient of a play's or a spring's column where its shape is about right: of one.
ITS_OWN = 0.6, 1.6
# Another law of a play, a spring or bristles is tried where one explains this share of the most: it may do as
# much.
WORTH_A_LAW = 0.8
# Log-posterior of all runs together, less its price, by which a cable surely hardens, or a wave is more than
# one: first moments take up much of any, and bent parameters foretell left-out runs by chance. And the
# log-likelihood by which a joint's torque is surely late, as a bus is, and does not lag, as a drive does.
SURELY = 10.0
# Log-posterior of all runs together that outweighs any that runs left out lose.
EVIDENCE_AGAINST_RUNS = 30.0
# First step of a refinement, as a share of the shape's range, and how many shapes are tried; where several go
# together, more of what is taken in.
STEP, TRIED, MORE_TRIED = 0.12, 14, 50


def choose(
    robot: Robot,
    stage: Stage,
    material: Sequence[Weighed],
    open_: Sequence[Weighed],
    without: Sequence[str] = (),
) -> tuple[Weighed, tuple[tuple[Weighed, float], ...], tuple[Design, Fit]] | None:
    """The shortlist refined and compared by one set of weights: the best, fitted in full, and its rivals.

    None where the hypothesis fits worse with any of it, fitted in full, by more than its price.

    A rival is what has little left to explain once the best is in; anything else is another effect. robot:
    that sizes are relative to. material, open_: best first; of the second, what fits a listed effect's joint
    best is listed too, and beside a spring the joint's other one. without: effects out of the catalogue.
    """
    likeliest = material[:SHORTLIST]
    fitting = [each for w in likeliest for each in _that_fit(w, open_)]
    best_of_each = {w.candidate.place: w for w in [*likeliest, *fitting]}
    shortlist = [refined(robot, stage, weighed) for weighed in best_of_each.values()]
    worth = WORTH_A_LAW * max(weighed.score for weighed in shortlist)
    shortlist = [each if each.score < worth else _by_its_law(robot, stage, each) for each in shortlist]
    shortlist += [
        _by_its_law(robot, stage, refined(robot, stage, each)) for each in _other_springs(shortlist, open_)
    ]
    if DELAY not in without:
        shortlist += _late_alone(robot, stage, shortlist)
    listed = [weighed.candidate for weighed in shortlist]
    compared = [stage.compared(each) for each in listed]
    # Of many shapes one is the likelier to fit by chance.
    foretold = [
        log_likelihood(*trial) - float(np.log(each.shapes)) - (SURELY if each.is_late_alone else 0.0)
        for each, trial in zip(listed, compared, strict=True)
    ]
    likelihoods = _by_all_runs(listed, compared, foretold)
    first, before = int(np.argmax(likelihoods)), log_likelihood(stage.hypothesis, stage.fitted)
    if len(searched_for(shortlist[first].candidate)) > 1:
        shortlist[first] = refined(robot, stage, shortlist[first], MORE_TRIED)
    # The price is for rivals; here nothing is to make the fit far worse.
    if likelihoods[first] + price(stage.hypothesis, listed[first]) <= before and not _is_told_by_all_runs(
        stage, compared[first]
    ):
        return None
    shortlist[first], trial = _likelier(robot, stage, shortlist[first])
    after = Stage(stage.ground, *trial)
    left = after.gains(Bank(stage.ground, [w.candidate for w in shortlist]))
    kept = [first]
    for index, (weighed, gain) in enumerate(zip(shortlist, left, strict=True)):
        if index != first and (gain is None or gained(after, gain) < RIVAL_LEFT * weighed.score):
            kept.append(index)
    probability = odds([likelihoods[index] for index in kept], shortlist[first].score)
    rivals = zip((shortlist[index] for index in kept[1:]), probability[1:].tolist(), strict=True)
    # By weights of its own hypothesis it may gain more: the stage's may not suit it.
    exact = stage.as_fitted(shortlist[first].gain, trial)
    best = max(shortlist[first], Weighed(exact, gained(stage, exact)), key=lambda w: w.score)
    return best, tuple(sorted(rivals, key=lambda r: -r[1])), trial


def _is_told_by_all_runs(stage: Stage, trial: tuple[Design, Fit]) -> bool:
    """Whether all runs together have what bends all parameters, the last effect, whatever left-out ones say.

    Where a run that is left out was the fast one, the parameters are extrapolated to it. A delay and the
    log's timing make a column of each other that only one of them at a time has: the prior keeps the timing
    near its size, and nothing the delay, so that this tells it from the timing by any evidence.
    """
    last = trial[0].accepted[-1]
    is_delay = last.is_common_delay
    if not is_delay and not bends_parameters(last.family):
        return False
    least = 0.0 if is_delay else EVIDENCE_AGAINST_RUNS
    more = log_posterior(*trial) - log_posterior(stage.hypothesis, stage.fitted)
    return more > max(price(stage.hypothesis, last), least)


def _by_all_runs(
    listed: Sequence[Candidate], compared: Sequence[tuple[Design, Fit]], likelihoods: Sequence[float]
) -> list[float]:
    """The log-likelihoods with what bends all parameters held against its like by what all runs together say.

    Its like is the same effect of another joint, and the other error of the joint's encoder. Each bends its
    own columns, and those of the wrong one otherwise: each is fitted with the runs linearised anew, and its
    own weights. Bent parameters foretell left-out runs by chance. compared: the hypothesis with each of
    those listed.
    """
    found = list(likelihoods)
    first = int(np.argmax(found))
    family = listed[first].family

    def is_alike(index: int) -> bool:
        other = listed[index].family
        if other.joint == family.joint and {other.effect, family.effect} <= set(OF_ENCODER):
            return True
        near = found[index] > found[first] - AS_LIKELY
        return near and other.effect == family.effect and bends_parameters(family)

    near = [index for index in range(len(listed)) if is_alike(index)]
    if len(near) < 2:
        return found
    exact = []
    for index in near:
        hypothesis, fitted = linearised_anew(*compared[index])
        exact.append(log_posterior(hypothesis, fitted) - price(hypothesis, listed[index]))
    for index, own in zip(near, exact, strict=True):
        found[index] = likelihoods[first] + own - max(exact)
    return found


def _likelier(robot: Robot, stage: Stage, best: Weighed) -> tuple[Weighed, tuple[Design, Fit]]:
    """The best at the shape that all runs together have likeliest, where that is likelier; and its fit.

    The weights of the hypothesis without it may not suit it, and a shape not quite right leaves a rest.
    """
    trial = stage.with_effects([best.candidate])
    if not is_searched(best.candidate):
        return best, trial
    likeliest = at_likeliest_shape(robot, *trial, len(trial[0].accepted) - 1)
    if likeliest is best.candidate:
        return best, trial
    gain, other = stage.gain(likeliest), stage.with_effects([likeliest])
    if gain is None or log_likelihood(*other) <= log_likelihood(*trial):
        return best, trial
    return Weighed(gain, gained(stage, gain)), other


def _that_fit(likely: Weighed, open_: Sequence[Weighed]) -> list[Weighed]:
    """The effect of its joint that fits better than any other, though it may predict less; of a spring all.

    First moments take up much of a cable and of a gravity spring, so that either may be the other.
    """
    own = [w for w in open_ if w.candidate.family.joint == likely.candidate.family.joint and w.score > 0]
    best = max(own, key=lambda w: w.gain.objective, default=likely)
    if likely.candidate.family.effect not in SPRINGS:
        return [best]
    return [best, *(w for w in own if w.candidate.family.effect in SPRINGS)]


def _other_springs(shortlist: Sequence[Weighed], open_: Sequence[Weighed]) -> list[Weighed]:
    """Elasticities that are not listed, where the likeliest effect is a play or a spring that is not its own.

    A spring that hardens has three shapes, and may look like nothing at all of those that are tried first.
    """
    best = max(shortlist, key=lambda each: each.score)
    least, most = ITS_OWN
    if best.candidate.family.effect not in TRANSMISSIONS or least < best.gain.coefficients[0] < most:
        return []
    listed = {each.candidate.place for each in shortlist}
    return [w for w in open_ if w.candidate.family.effect == ELASTIC and w.candidate.place not in listed]


def _late_alone(robot: Robot, stage: Stage, shortlist: Sequence[Weighed]) -> list[Weighed]:
    """Delays of one joint alone, of those whose drives may lag: slow motion hardly tells which."""
    # Of a robot of one joint every delay is common, and where one is known the rest is a drive's.
    if stage.prepared.joints == 1 or any(each.is_common_delay for each in stage.hypothesis.accepted):
        return []
    logged, found = [run.logged for run in stage.prepared.runs], []
    for lag in (each.candidate for each in shortlist if each.candidate.family.effect == LAG):
        family = effect(DELAY).signature(logged, lag.family.joint, None)
        late = _best_of(robot, stage, family, family.members)
        found += [each for each in late if not _lags_behind_all(stage, lag, each.candidate)]
    return found


def _lags_behind_all(stage: Stage, lag: Candidate, late: Candidate) -> bool:
    """Whether a lag beside a delay of all joints is likelier than one joint that is late alone."""
    prepared, trial = stage.prepared, stage.with_effects([lag])
    delay, _ = likeliest_delay(*trial)
    family = effect(DELAY).signature([run.logged for run in prepared.runs], None, None)
    if delay <= 0 or family.member is None:
        return False
    common = candidate(prepared, family, family.member({"difference": delay}))
    both = log_posterior(*stage.with_effects([lag, common])) - price(trial[0], common)
    return both > log_posterior(*stage.with_effects([late]))


def _by_its_law(robot: Robot, stage: Stage, found: Weighed) -> Weighed:
    """What was refined; of plays, springs and bristles, by the law that is likeliest at its best shape.

    Far from it, one of another law may seem the likelier.
    """
    family, law = found.candidate.family, found.candidate.member.law
    if family.effect == CABLE:
        return _cable(robot, stage, found)
    if family.effect not in (*TRANSMISSIONS, BRISTLES):
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
    """A cable that hardens, where all runs surely tell it from the best by its other laws; else that."""
    family, hardens = found.candidate.family, found.candidate.member.law == HARDENING
    others = [each for each in family.members if each.law != HARDENING]
    lines = _best_of(robot, stage, family, others) if hardens else [found]
    if not lines:
        return found
    (line,) = lines
    members = [each for each in family.members if each.law == HARDENING]
    hoses = [found] if hardens else _best_of(robot, stage, family, members)
    hose = max([*hoses, *_hardly_hardening(robot, stage, line)], key=lambda each: each.score, default=line)
    if hose.score <= line.score or _told(stage, hose, line) < 0:
        return line
    # Where it rests has several likeliest places.
    starts = [each for member in members for each in likeliest_of(stage, family, [member])]
    hose = max([hose, *(refined(robot, stage, each) for each in starts)], key=lambda each: each.score)
    return _surely(stage, refined(robot, stage, hose, MORE_TRIED), line)


def _hardly_hardening(robot: Robot, stage: Stage, line: Weighed) -> list[Weighed]:
    """The cable that hardens as little as any from where the line rests, refined, where that is likelier."""
    family = line.candidate.family
    assert family.member is not None
    rest = quantities(line.candidate, line.gain.coefficients)["rest"].value
    within = float(np.clip(rest, *family.refine["rest"]))
    hose = family.member({"rest": within, "doubling": family.refine["doubling"][1]})
    likeliest = likeliest_of(stage, family, [hose])
    return [refined(robot, stage, each, MORE_TRIED) for each in likeliest if each.score > line.score]


def _richer(robot: Robot, stage: Stage, found: Weighed) -> Weighed:
    """What was refined by a law that has its own in it, where all runs surely tell the richer; else that."""
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
    """An effect by another law where all runs together surely tell it from the plain one; else that."""
    return other if _told(stage, other, plain) > SURELY else plain


def _told(stage: Stage, other: Weighed, plain: Weighed) -> float:
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
