"""Rules for reporting an accepted effect: it is larger than on healthy robots, and probably a fault."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from testbench.effects.push import begin_with_runs
from testbench.robot import Robot

from ..data.run import Prepared
from ..fit.likelihood import Weighed, gained_by_shift
from ..fit.normal_equations import Fit, squares
from ..fit.score import Stage
from ..model.candidate import Candidate
from ..model.effect_sizes import is_beyond_healthy, is_excessive, times_healthy
from ..model.hypothesis import FEWEST_INDEPENDENT, FEWEST_OF_ALL, Design
from ..plausibility.accepted import Accepted
from ..plausibility.materiality import BEYOND, SMALLEST_WALD
from .probability import STATED, Size, fault_probability

Array = NDArray[np.float64]

# A rival this probable explains it as well: these runs cannot distinguish them.
CONFUSABLE = 0.1
# Share of a joint's squared residual that half the motion determines for sure.
NEARLY_ALL = 0.8


@dataclass(frozen=True)
class Found:
    """The effect that a search round accepts, its rivals, and the hypothesis with it and its fit."""

    best: Weighed
    rivals: tuple[tuple[Weighed, float], ...]
    trial: tuple[Design, Fit]


def accepted_as(found: Found, stage: Stage, sized: Robot) -> Accepted:
    """The effect that a round has found, as an accepted one, and whether it may be reported."""
    best, torque_rms = found.best, stage.base.torque_rms
    own = best.candidate, found.trial[1].values[-best.candidate.count :]
    share = float(stage.shares(best.gain).max())
    # Where an imperfection of healthy size would explain it as well, nothing else need be there.
    as_well = [(w.candidate, w.gain.coefficients) for w, p in found.rivals if p > CONFUSABLE]
    beyond = all(is_beyond_healthy(sized, torque_rms, *each) for each in (own, *as_well))
    beyond = beyond and not is_how_runs_begin(stage.prepared, best.candidate)
    samples = stage.independent[list(best.candidate.member.rows)]
    # An effect of the whole robot shows at all joints.
    independent = samples.max() if best.candidate.family.joint is not None else samples.sum()
    taken_off = np.maximum(stage.held_squares - squares(found.trial[1].held_out), 0)
    return Accepted(
        candidate=best.candidate,
        probability=1.0 - sum(p for _, p in found.rivals),
        rivals=found.rivals,
        score=best.score,
        share=share,
        worth=float(np.sum(taken_off / np.maximum(stage.counts, 1) / torque_rms**2)),
        shift=gained_by_shift(stage, best.gain),
        named=bool(beyond and independent >= (FEWEST_OF_ALL if share > NEARLY_ALL else FEWEST_INDEPENDENT)),
    )


def is_how_runs_begin(prepared: Prepared, each: Candidate) -> bool:
    """Whether a push acts as its runs begin and never after; False for any other effect.

    So do brakes that are let go, and friction that held a joint before the log.
    """
    return each.is_event and begin_with_runs([run.logged for run in prepared.runs], each.member.columns)


def likely_faults(
    sized: Robot,
    hypothesis: Design,
    fitted: Fit,
    accepted: Sequence[Accepted],
    open_: Sequence[Weighed],
) -> list[Accepted]:
    """The accepted effects with their probabilities of being faults; those too improbable are not reported.

    open_: effects that were not accepted, whose sizes show as well how imperfect this robot's joints are.
    """
    prepared = hypothesis.prepared
    torque_rms = hypothesis.base.torque_rms

    def size(candidate: Candidate, coefficients: Array) -> Size:
        times = times_healthy(sized, torque_rms, candidate, coefficients)
        return Size(candidate.family.effect, candidate.family.joint, times)

    parts = zip(hypothesis.accepted, hypothesis.parts, strict=True)
    sizes = [size(candidate, fitted.values[part]) for candidate, part in parts]
    others = [size(w.candidate, w.gain.coefficients) for w in open_ if w.gain.wald > SMALLEST_WALD]
    found, before = [], 0.0
    for item, own in zip(accepted, sizes, strict=True):
        family = item.candidate.family
        # A joint that moves in one run alone has one, however many there are of the others.
        runs = prepared.runs_with(family.joint, family.into)
        # Parameters brought back from where earlier effects had moved them speak for nothing.
        shift = item.shift + min(before, 0.0)
        before += item.shift
        fault = fault_probability(own, [*sizes, *others], item.share, shift, runs)
        withdrawn = item.named and fault < STATED
        alike = withdrawn and fault_probability(own, (), item.share, shift, runs) >= STATED
        found.append(
            replace(
                item,
                fault=fault,
                named=item.named and not withdrawn,
                is_everywhere=item.is_everywhere or alike,
                is_suspected=item.is_suspected or withdrawn,
            )
        )
    return found


def as_fitted_at_last(
    sized: Robot, hypothesis: Design, fitted: Fit, accepted: Sequence[Accepted]
) -> list[Accepted]:
    """The accepted effects with their final shapes and sizes, as fitted to all runs together.

    An effect is no longer reported where it is larger than any gear has it, no larger than on a healthy
    robot, or not distinguished from zero.
    """
    found, torque_rms = [], hypothesis.base.torque_rms
    for item, part, candidate in zip(accepted, hypothesis.parts, hypothesis.accepted, strict=True):
        own = candidate, fitted.values[part]
        named = item.named and not is_excessive(sized, *own, item.share)
        named = named and times_healthy(sized, torque_rms, *own) > 1
        # A limit that the drive reports leaves no gap, and a push is recognised by its time.
        named = named and (candidate.description.at_times or fitted.wald(part) > BEYOND**2)
        found.append(replace(item, candidate=candidate, named=named))
    return found
