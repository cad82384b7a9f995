"""Search for effects that re-identified parameters absorb, with every joint's imperfections fitted, too.

A gain error, an offset of an encoder, a payload or a spring leaves a small trace in what is left; any
robot's own imperfections leave larger ones, which would hide it or be taken for it. An effect that bends all
parameters shows in all runs together and in how near to the model it lets the parameters be: left-out runs,
predicted by bent parameters, say next to nothing of it.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..fit.likelihood import Weighed, by_chance, gained_by_joint, gained_by_shift, log_posterior, weigh
from ..fit.linearisation import bends_parameters, linearised_anew
from ..fit.score import Stage
from ..model.candidates import Candidate
from ..model.effect_sizes import CABLE, SPRING
from ..model.gram import Bank
from .shortlist import EVIDENCE_AGAINST_RUNS

# What any joint has a little of, and what is fitted beside: friction, ripple, cables.
IMPERFECTIONS = (
    "stribeck_friction",
    "asymmetric_friction",
    "nonlinear_viscous_friction",
    "load_dependent_friction",
    "presliding_hysteresis",
    "transmission_ripple",
    "cable_spring",
)
# Effects that leave no more than a trace on many motions, and are treated as absorbed.
TRACES = ("encoder_eccentricity", "base_tilt")
# Log-likelihood from which an imperfection is worth fitting beside, that a trace must gain, and that must be
# left of it without any one joint but its own.
BESIDE, SMALLEST_GAIN, SMALLEST_ELSEWHERE = 8.0, 9.0, 5.0
# Of what bends all parameters: Wald's statistic from which it is fitted in full, and the log-likelihood that
# it may lose by runs left out.
WORTH_A_FIT, AGAINST = 9.0, -5.0
# The log-posterior of all runs together that it must add with one coefficient, and with more.
EVIDENCE_OF_ONE, EVIDENCE_OF_MORE = 4.5, 7.5
# And where it may lose any, as who leaves the one fast run out extrapolates to it.
WORTH_A_FIT_AGAINST = 25.0


def swallowed(stage: Stage, weighed: Sequence[Weighed]) -> tuple[Stage, list[Weighed]]:
    """The stage with the joints' imperfections fitted, too, and the absorbed effects that show there.

    Best first. weighed: all effects that the stage has not, best first.
    """
    after = _with_imperfections(stage, weighed)
    hidden = [w.candidate for w in weighed if _is_hidden(w.candidate) or _is_spring(w, weighed)]
    found = weigh(after, Bank(stage.ground, hidden)) if hidden else []
    bending = [each for each in found if bends_parameters(each.candidate.family)]
    others = [each for each in found if not bends_parameters(each.candidate.family)]
    told = [*_foretold(after, others), *_by_all_runs(after, bending)]
    return after, sorted(told, key=lambda each: -each.score)


def _foretold(stage: Stage, found: Sequence[Weighed]) -> list[Weighed]:
    """Effects that left-out runs support, and not only by one joint's misfit."""
    found = [each for each in found if each.score > SMALLEST_GAIN]
    return [each for each in found if _elsewhere(stage, each) > SMALLEST_ELSEWHERE]


def _by_all_runs(stage: Stage, found: Sequence[Weighed]) -> list[Weighed]:
    """Effects that all runs together support, by the log-posterior each adds with runs linearised anew."""
    found = [each for each in found if _is_worth_a_fit(stage, each)]
    if not found:
        return []
    before, told = log_posterior(*linearised_anew(stage.hypothesis, stage.fitted)), []
    for each in found:
        hypothesis, fitted = linearised_anew(*stage.compared(each.candidate))
        evidence = log_posterior(hypothesis, fitted) - before
        if evidence > _smallest_evidence(each):
            gain = replace(each.gain, coefficients=fitted.values[hypothesis.parts[-1]])
            told.append(Weighed(gain, evidence))
    return told


def _is_worth_a_fit(stage: Stage, weighed: Weighed) -> bool:
    """Whether it is fitted in full: by Wald's statistic, or the shift of the parameters that it spares."""
    wald, foretells = weighed.gain.wald, weighed.score > AGAINST
    if wald > (WORTH_A_FIT if foretells else WORTH_A_FIT_AGAINST):
        return True
    return wald > WORTH_A_FIT and gained_by_shift(stage, weighed.gain) > EVIDENCE_AGAINST_RUNS


def _smallest_evidence(weighed: Weighed) -> float:
    """Log-posterior from which it is believed: of many coefficients some suit by chance."""
    if weighed.score <= AGAINST:
        return EVIDENCE_AGAINST_RUNS
    count = weighed.candidate.count
    return EVIDENCE_OF_ONE if count == 1 else EVIDENCE_OF_MORE + by_chance(weighed.candidate)


def _with_imperfections(stage: Stage, weighed: Sequence[Weighed]) -> Stage:
    """The stage with every imperfection that is worth it, the best of each joint at a time.

    One of a joint's leaves what its others do, and a moved parameter somewhere else can imitate that.
    """
    open_ = [w for w in weighed if w.candidate.family.effect in IMPERFECTIONS and not _is_spring(w, weighed)]
    while best := _best_of_joints(open_):
        stage = Stage(stage.ground, *stage.with_effects(best))
        taken = {candidate.place for candidate in best}
        rest = [w.candidate for w in open_ if w.candidate.place not in taken]
        open_ = weigh(stage, Bank(stage.ground, rest)) if rest else []
    return stage


def _is_hidden(candidate: Candidate) -> bool:
    """Whether it leaves no more than a trace."""
    return candidate.family.swallowed or candidate.family.effect in TRACES


def _is_spring(cable: Weighed, weighed: Sequence[Weighed]) -> bool:
    """Whether a cable is better explained by a gravity spring at its joint."""
    name, joint = cable.candidate.family.effect, cable.candidate.family.joint
    return name == CABLE and any(
        (w.candidate.family.effect, w.candidate.family.joint) == (SPRING, joint) and w.score > cable.score
        for w in weighed
    )


def _best_of_joints(weighed: Sequence[Weighed]) -> list[Candidate]:
    """The first effect of each joint that is worth fitting besides."""
    best: dict[int, Candidate] = {}
    for each in weighed:
        joint = each.candidate.family.joint
        if joint is not None and each.score > BESIDE:
            best.setdefault(joint, each.candidate)
    return list(best.values())


def _elsewhere(stage: Stage, weighed: Weighed) -> float:
    """Score without the joint that gains most, unless it is the joint that the effect acts on.

    Parameters moved by an effect may happen to suit another joint's misfit.
    """
    rows = weighed.candidate.member.rows
    by_joint = gained_by_joint(stage, weighed.gain)
    others = np.delete(by_joint, rows) if len(rows) == 1 else by_joint
    return weighed.score - float(np.max(others, initial=0.0))
