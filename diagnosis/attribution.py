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

from testbench.effects import effects
from testbench.robot import Robot

from .accepted import Accepted, is_rest_of_delay, laws_of_position
from .candidates import EVENT, SATURATION, Candidate, candidate, candidates
from .contact import contact
from .evidence import Design, Fit, fitted_to, log_prior, squares, standard_values
from .generic import generic_candidates
from .ground import Ground, ground
from .likelihood import Weighed, gained, weigh
from .materiality import (
    is_beyond_healthy,
    is_main,
    is_material,
    is_plausible,
    with_friction,
)
from .observability import not_observable
from .preparation import Prepared
from .saturation import Cut, cuts, saturation
from .shortlist import choose
from .swallowed import swallowed
from .unclaimed import Unclaimed, unclaimed
from .weighing import Bank, Stage

Array = NDArray[np.float64]

MOST_EFFECTS, MOST_TERMS = 6, 10
# A rival this probable cannot be told apart on these runs.
CONFUSABLE = 0.1
# Wald's statistic of what is named: five standard deviations. A trace may have four, with this share of some
# joint's rest: what misfit leaves rarely has.
SMALLEST_WALD, TRACE_WALD, SMALLEST_TRACE = 25.0, 16.0, 0.025
# Beside these the runs are linearised anew: they move the parameters that columns are taken at, or their own
# columns hold near what was fitted only.
RELINEARISED = (
    "encoder_offset",
    "encoder_eccentricity",
    "payload",
    "base_tilt",
    "torque_gain_error",
    "torque_delay",
    "thermal_friction_drift",
)


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
    prepared = linearised(prepared, *fitted_to(prepared, []))
    hypothesis, fitted = fitted_to(prepared, [])
    first = hypothesis, fitted
    sized = with_friction(prepared.robot, standard_values(prepared, fitted))
    # A limit and a push of the surroundings are sought in ways of their own.
    early = [*without, SATURATION, EVENT]
    base = ground(prepared)
    proposals, free = (Bank(base, c) for c in (candidates(prepared, early), generic_candidates(prepared)))
    original, limits = Stage(base, hypothesis, fitted), cuts(prepared)
    # What an effect of the whole robot explains at a joint has nothing to do with the joint's own.
    apart = original
    accepted: list[Accepted] = []
    weighed: list[Weighed] = []
    while len(accepted) < MOST_TERMS and sum(a.named for a in accepted) < MOST_EFFECTS:
        stage = Stage(base, hypothesis, fitted)
        before = [item.candidate for item in accepted]
        weighed = _open(stage, before, proposals, sized)
        if before and before[-1].family.joint is None:
            apart = stage
        found = _next(original, stage, before, weighed, free, limits, sized, without)
        if found is None:
            break
        # Where an imperfection of healthy size would explain it as well, nothing else need be there.
        best, own = found.best, found.trial[1].values[-found.best.candidate.count :]
        sizes = [
            (best.candidate, own),
            *((w.candidate, w.gain.coefficients) for w, p in found.rivals if p > CONFUSABLE),
        ]
        taken_off = np.maximum(stage.held_squares - squares(found.trial[1].held_out), 0)
        somewhere = {a.candidate.family.joint for a in accepted if a.named}
        beyond = all(is_beyond_healthy(sized, base.torque_rms, *each) for each in sizes)
        accepted.append(
            Accepted(
                candidate=best.candidate,
                probability=1.0 - sum(p for _, p in found.rivals),
                rivals=found.rivals,
                share=float(stage.shares(best.gain).max()),
                worth=float(np.sum(taken_off / np.maximum(stage.counts, 1) / base.torque_rms**2)),
                named=beyond and is_main(apart, stage, best.gain, somewhere) and found.is_certain(stage),
                is_trace=found.is_trace,
            )
        )
        hypothesis, fitted = found.trial
        if best.candidate.family.effect in RELINEARISED:
            prepared = linearised(prepared, hypothesis, fitted)
            base = ground(prepared)
            proposals = Bank(base, candidates(prepared, early))
            free = Bank(base, generic_candidates(prepared))
            accepted = [replace(a, candidate=_again(prepared, a.candidate)) for a in accepted]
            hypothesis, fitted = fitted_to(prepared, [a.candidate for a in accepted])
        if found.is_trace:
            # It was sought last; beside it, any other trace is a rest of it.
            break
    accepted, hypothesis, fitted = _pruned(base, accepted, hypothesis, fitted)
    last = Stage(base, hypothesis, fitted)
    unknown = (*unclaimed(original, last, free), *laws_of_position(original, last, accepted))
    taken = {item.candidate.place for item in accepted}
    open_ = [w for w in weigh(last, proposals) if w.candidate.place not in taken]
    hidden = not_observable(sized, base.torque_rms, open_)
    misfit = {item.joint for item in unknown}
    # What is named beside a larger misfit of the same joint only imitates a part of it.
    imitates = [a.candidate.family.joint in misfit or is_rest_of_delay(a, accepted) for a in accepted]
    accepted = [replace(a, named=a.named and not other) for a, other in zip(accepted, imitates, strict=True)]
    return Attribution(prepared, tuple(accepted), hypothesis, fitted, first, unknown, tuple(weighed), hidden)


@dataclass(frozen=True)
class _Found:
    """What a round takes in, with its rivals and the hypothesis that has it. is_trace: as of Accepted."""

    best: Weighed
    rivals: tuple[tuple[Weighed, float], ...]
    trial: tuple[Design, Fit]
    is_trace: bool = False

    def is_certain(self, stage: Stage) -> bool:
        """Whether its size is known well enough for a name.

        Pushes, limits and what shows in the parameters' shift are judged where they are sought.
        """
        family = self.best.candidate.family
        if family.effect in (EVENT, SATURATION) or (family.swallowed and not self.is_trace):
            return True
        own = slice(-self.best.candidate.count, None)
        fitted = self.trial[1]
        wald = fitted.values[own] @ np.linalg.pinv(fitted.covariance[own, own]) @ fitted.values[own]
        if self.is_trace:
            return bool(wald > TRACE_WALD and stage.shares(self.best.gain).max() > SMALLEST_TRACE)
        return bool(wald > SMALLEST_WALD)


def _open(stage: Stage, before: Sequence[Candidate], proposals: Bank, sized: Robot) -> list[Weighed]:
    """Every effect that may still be taken in, best first."""
    taken = {each.place for each in before}
    return [
        w
        for w in weigh(stage, proposals)
        if w.candidate.place not in taken and is_plausible(sized, w.candidate, w.gain.coefficients)
    ]


def _next(
    first: Stage,
    stage: Stage,
    before: Sequence[Candidate],
    weighed: Sequence[Weighed],
    free: Bank,
    limits: Sequence[Sequence[Cut]],
    sized: Robot,
    without: Sequence[str],
) -> _Found | None:
    """What explains most: a material effect or a limit; else a push; else a trace of what is swallowed."""
    material = [w for place, w in enumerate(weighed) if is_material(stage, w.gain, place == 0)]
    if SATURATION not in without:
        clipped = saturation(stage, before, free, limits)
        if clipped is not None and clipped.score > max((w.score for w in material), default=0.0):
            pushed = _pushed(stage, before, free, without)
            # Who withstands a push asks for torque as long as it lasts.
            if pushed is not None and _is_alike(pushed.best, clipped) and pushed.best.score > clipped.score:
                return pushed
            return _Found(clipped, (), fitted_to(stage.prepared, [*before, clipped.candidate]))
    if material:
        return _Found(*choose(stage, before, material))
    if (pushed := _pushed(stage, before, free, without)) is not None:
        return pushed
    if unclaimed(first, stage, free):
        # What has no name leaves traces of all kinds.
        return None
    after, traces = swallowed(stage, before, weighed)
    traces = [
        w
        for w in traces
        if is_plausible(sized, w.candidate, w.gain.coefficients)
        and is_beyond_healthy(sized, stage.ground.torque_rms, w.candidate, w.gain.coefficients)
    ]
    if not traces:
        return None
    best, rivals, _ = choose(after, after.hypothesis.accepted, traces)
    return _Found(best, rivals, fitted_to(stage.prepared, [*before, best.candidate]), is_trace=True)


def _pushed(stage: Stage, before: Sequence[Candidate], free: Bank, without: Sequence[str]) -> _Found | None:
    """A push of the surroundings, the only one."""
    if EVENT in without or any(each.is_event for each in before):
        return None
    found = contact(stage, free)
    if found is None:
        return None
    return _Found(*found, fitted_to(stage.prepared, [*before, found[0].candidate]))


def _is_alike(first: Weighed, second: Weighed) -> bool:
    return first.candidate.family.joint == second.candidate.family.joint


def linearised(prepared: Prepared, hypothesis: Design, fitted: Fit) -> Prepared:
    """The runs with loads and derivatives taken at the parameters just fitted."""
    return prepared.with_parameters(standard_values(prepared, fitted))


def _again(prepared: Prepared, old: Candidate) -> Candidate:
    """The same member recomputed after the runs were linearised anew."""
    if old.is_event:
        # A push's columns are of the motion alone.
        return old
    logged = [run.logged for run in prepared.runs]
    family = effects()[old.family.effect].signature(logged, old.family.joint, old.family.into)
    if family.member is not None and old.member.shape:
        return candidate(prepared, family, family.member(old.member.shape))
    return candidate(prepared, family, family.members[0])


def _pruned(
    base: Ground, accepted: list[Accepted], hypothesis: Design, fitted: Fit
) -> tuple[list[Accepted], Design, Fit]:
    """Take out, one by one, what is no longer material beside the others."""
    while len(accepted) > 1:
        rest = [
            fitted_to(base.prepared, [a.candidate for k, a in enumerate(accepted) if k != leave])
            for leave in range(len(accepted))
        ]
        worth = []
        for item, trial in zip(accepted, rest, strict=True):
            stage = Stage(base, *trial)
            gain = stage.gain(item.candidate)
            if gain is not None:
                # Both are fitted in full here, so what leaving it out costs is known exactly.
                gain = replace(
                    gain,
                    held_out=stage.held_squares - squares(fitted.held_out),
                    prior=float(log_prior(hypothesis, fitted.values)),
                )
            kept = item.candidate.is_event or item.is_trace
            # What was best when it was taken in is judged as such.
            keeps = kept or (gain is not None and is_material(stage, gain, is_best=True))
            worth.append((keeps, 0.0 if gain is None else gained(stage, gain)))
        weakest = min(range(len(worth)), key=lambda k: (worth[k][0], worth[k][1]))
        if worth[weakest][0]:
            break
        accepted = [a for k, a in enumerate(accepted) if k != weakest]
        hypothesis, fitted = rest[weakest]
    return accepted, hypothesis, fitted
