"""The shortlist of a round: its effects at their best shapes, fitted in full, the likeliest, its rivals."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from testbench.robot import Robot

from ..fit.likeliest_shapes import at_likeliest_shape, is_searched
from ..fit.likelihood import Weighed, gained, log_likelihood, log_posterior, odds, price
from ..fit.linearisation import bends_parameters, linearised_anew
from ..fit.normal_equations import Fit
from ..fit.score import Stage
from ..fit.shape_search import searched_for
from ..model.candidate import DELAY, Candidate
from ..model.gram import Bank
from ..model.hypothesis import Design
from ..proposals.laws import MORE_TRIED, by_its_law, late_alone, refined

Array = NDArray[np.float64]

SHORTLIST = 4
# What keeps less than this share of its log-likelihood once another effect is in explains the same thing.
RIVAL_LEFT = 0.5
# Log-likelihood by which a joint may seem less likely than another for what bends all parameters.
AS_LIKELY = 25.0
# Another law of a play, a spring or bristles is tried where one explains this share of the most: it may do as
# much.
WORTH_A_LAW = 0.8
# Prior odds that only one joint's torque is delayed, against a lag of its drive, which is far commoner.
LATE_ODDS = 1 / 8
# Log-posterior of all runs together that outweighs any that runs left out lose.
EVIDENCE_AGAINST_RUNS = 30.0


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
    shortlist = [each if each.score < worth else by_its_law(robot, stage, each) for each in shortlist]
    if DELAY not in without:
        shortlist += late_alone(robot, stage, shortlist)
    listed = [weighed.candidate for weighed in shortlist]
    compared = [stage.compared(each) for each in listed]
    # Of many shapes one is the likelier to fit by chance.
    predicted = [
        log_likelihood(*trial) - float(np.log(each.shapes))
        for each, trial in zip(listed, compared, strict=True)
    ]
    likelihoods = _behind_lags(listed, _by_all_runs(listed, compared, predicted))
    first, before = int(np.argmax(likelihoods)), log_likelihood(stage.hypothesis, stage.fitted)
    if len(searched_for(shortlist[first].candidate)) > 1:
        shortlist[first] = refined(robot, stage, shortlist[first], MORE_TRIED)
    # The price is for rivals; here nothing is to make the fit far worse.
    if likelihoods[first] + price(stage.hypothesis, listed[first]) <= before and not _is_shown_by_all_runs(
        stage, compared[first]
    ):
        return None
    shortlist[first], trial = _likelier(robot, stage, shortlist[first])
    after = Stage(*trial)
    left = after.gains(Bank(stage.base, [w.candidate for w in shortlist]))
    kept = [first]
    for index, (weighed, gain) in enumerate(zip(shortlist, left, strict=True)):
        if index != first and (gain is None or gained(after, gain) < RIVAL_LEFT * weighed.score):
            kept.append(index)
    before_runs = [LATE_ODDS if listed[index].is_late_alone else 1.0 for index in kept]
    probability = odds([likelihoods[index] for index in kept], shortlist[first].score, before_runs)
    rivals = zip((shortlist[index] for index in kept[1:]), probability[1:].tolist(), strict=True)
    # By weights of its own hypothesis it may gain more: the stage's may not suit it.
    exact = stage.as_fitted(shortlist[first].gain, trial)
    best = max(shortlist[first], Weighed(exact, gained(stage, exact)), key=lambda w: w.score)
    return best, tuple(sorted(rivals, key=lambda r: -r[1])), trial


def _is_shown_by_all_runs(stage: Stage, trial: tuple[Design, Fit]) -> bool:
    """Whether all runs together have what bends all parameters, the last effect, whatever left-out ones say.

    Where a run that is left out was the fast one, the parameters are extrapolated to it. A delay and the
    log's timing make a column of each other that only one of them at a time has: the prior keeps the timing
    near its size, and nothing the delay, so that this distinguishes it from the timing by any evidence.
    """
    last = trial[0].accepted[-1]
    is_delay = last.is_common_delay
    if not is_delay and not bends_parameters(last):
        return False
    least = 0.0 if is_delay else EVIDENCE_AGAINST_RUNS
    more = log_posterior(*trial) - log_posterior(stage.hypothesis, stage.fitted)
    return more > max(price(stage.hypothesis, last), least)


def _by_all_runs(
    listed: Sequence[Candidate], compared: Sequence[tuple[Design, Fit]], likelihoods: Sequence[float]
) -> list[float]:
    """The log-likelihoods, with effects that bend all parameters compared to their like by all runs together.

    Its like is the same effect of another joint, and the other error of the joint's encoder. Each bends its
    own columns, and those of the wrong one otherwise: each is fitted with the runs linearised anew, and its
    own weights. Bent parameters predict left-out runs by chance. compared: the hypothesis with each of
    those listed.
    """
    found = list(likelihoods)
    first = int(np.argmax(found))
    best = listed[first]

    def is_alike(index: int) -> bool:
        other = listed[index]
        is_same_joint = other.family.joint == best.family.joint
        if is_same_joint and best.description.of_encoder and other.description.of_encoder:
            return True
        near = found[index] > found[first] - AS_LIKELY
        return near and other.family.effect == best.family.effect and bends_parameters(best)

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


def _behind_lags(listed: Sequence[Candidate], likelihoods: Sequence[float]) -> list[float]:
    """The log-likelihoods, with the delay of one joint only no likelier than a lag of its drive.

    Drives lag, and a bus is late at every joint. As no current loop is quite of first or second order, a
    delay that seems likelier is mostly a lag.
    """
    lags = {
        each.family.joint: own
        for each, own in zip(listed, likelihoods, strict=True)
        if each.description.is_lag
    }
    return [
        min(own, lags[each.family.joint]) if each.is_late_alone else own
        for each, own in zip(listed, likelihoods, strict=True)
    ]


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
    if not likely.candidate.description.of_position:
        return [best]
    return [best, *(w for w in own if w.candidate.description.of_position)]
