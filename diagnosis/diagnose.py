"""The whole diagnosis of a robot's logs: where, which, how far."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from recordings.checks.finding import Finding, barring
from testbench.log import Recording
from testbench.robot import Robot

from .correction.corrected_model import corrected_by
from .correction.residual_near_rest import left_at_rest
from .data.preparation import Prepared
from .data.single_sine import one_sine
from .decision.attribution import Attribution
from .decision.doubts import ONE_SINE, TOO_SHORT, doubt, is_too_short, with_support
from .decision.findings import Diagnosis, Gap, NamedEffect, RankedCandidate
from .decision.harmful_effects import without_misleading, without_undetermined
from .decision.held_out_check import closed_without_a_name, names_that_hold, pushes_that_hold
from .decision.probability import STATED
from .decision.reported_effects import is_how_runs_begin
from .fit.normal_equations import Fit, rms, standard_values
from .fit.shape_covariance import covariance_with_shapes
from .fit.torque_alignment import aligned
from .held_out.differing_runs import without_differences
from .held_out.prior_strength import with_predictive_prior
from .held_out.recurring_push import recurrence
from .held_out.shrinkage import Kept, everything, shares_kept
from .model.hypothesis import Design
from .plausibility.accepted import Accepted
from .report.sentence import UNSURE, sentence_of, unclaimed_in_words
from .residual.intervals import rms_interval
from .residual.localisation import where
from .residual.noise import noise
from .residual.spectrum import above_band
from .residual.unexplained import NOTHING
from .search.growth import CONFUSABLE, attribute

Array = NDArray[np.float64]

# Re-identification matters when it takes this share off some joint's error on runs left out ...
PARAMETERS_SHARE = 0.12
# ... and the error of the model as given is at least this share of the joint's torque.
PARAMETERS_TORQUE = 0.01
# What follows nothing is the verdict where no effect explains this share of it.
FAR_LESS = 0.2


def diagnose(
    robot: Robot,
    recordings: Mapping[str, Recording],
    without: Sequence[str] = (),
    cutoff: float | None = None,
    payloads: Mapping[str, float] | None = None,
    log_findings: tuple[Finding, ...] = (),
) -> Diagnosis:
    """Why the model and the logs disagree.

    recordings: runs by name; their truth, where a simulation has written one, is not looked at.
    without: effects taken out of the catalogue. cutoff: Hz, no joint's band is wider; None for what its
    encoders leave. payloads: kg, known to be in one run and in no other, by its name. log_findings: of the
    checks of these logs. Raises InputError for runs that are too short.
    """
    alike, differences = without_differences(aligned(robot, recordings, cutoff), payloads)
    found = without_undetermined(attribute(alike, without))
    prepared = found.prepared
    only = found.parameters_only[0], with_predictive_prior(*found.parameters_only)
    found, (hypothesis, fitted) = without_misleading(found, only)
    final = hypothesis, with_predictive_prior(hypothesis, fitted)
    again = recurrence(*final)
    model = corrected_by(only[1], final, again, everything(robot.joints))
    barred = barring(log_findings)
    torque, sines = _torque(prepared), one_sine(prepared)
    kept, supported, left = _kept(only, final, left_at_rest(prepared, model), torque, barred is None)
    only, gap = (only[0], replace(only[1], held_out=left[1])), _gap(prepared, final[0], left)
    fitted_gap = rms(final[1].residual, final[0])
    accepted, unmet = names_that_hold(found.accepted, gap, fitted_gap, torque)
    told = {each.joint for each in (*found.unknown, *unmet)}
    untold = [each for each in closed_without_a_name(accepted, gap, torque) if each.joint not in told]
    accepted, bursts = pushes_that_hold(accepted, gap)
    found = replace(found, accepted=accepted, unknown=(*found.unknown, *unmet, *untold, *bursts))
    found = _without_doubtful(found, supported, sines)
    if (alone := _hardly_seen(found, gap)).any() and kept.effects[alone].any():
        # What other joints' motion would make of them was never seen.
        kept = kept.without_effects(alone)
        found = replace(found, accepted=with_support(found.accepted, supported & ~alone))
        effects_left = tuple(np.where(alone, a, b) for a, b in zip(left[1], left[2], strict=True))
        gap = _gap(prepared, final[0], (left[0], left[1], effects_left))
    named, effects = _named_effects(found)
    if barred is None:
        verdict = _verdict(found, gap)
        sentence = sentence_of(robot, verdict, effects, found.unknown, gap, torque)
    else:
        # With such a gap, any reported effect stands for a part of it.
        stop = "" if barred.sentence.endswith("?") else "."
        verdict, sentence = (
            "unknown",
            f"{barred.sentence}{stop} Mend that first: beside it no effect is named.",
        )
    fitted = final[1]
    return Diagnosis(
        robot=robot,
        verdict=verdict,
        sentence=sentence,
        effects=effects if verdict == "effect" else (),
        ranked=_ranked(
            found,
            {index: each.probability for index, each in zip(named, effects, strict=True)}
            if verdict == "effect"
            else {},
        ),
        where=where(prepared, only, gap.noise_floor),
        gap=gap,
        prepared=prepared,
        parameters_only=only,
        final=final,
        parameters=standard_values(prepared, fitted.values),
        timing=float(fitted.values[hypothesis.timing]),
        kept=kept,
        not_observable=found.hidden,
        notes=tuple(unclaimed_in_words(robot, item) for item in found.unknown),
        recurrence=again,
        everywhere=tuple(
            (a.candidate.family.effect, a.candidate.family.joint) for a in found.accepted if a.is_everywhere
        ),
        one_sine=sines,
        differences=differences,
        log_findings=log_findings,
    )


def _hardly_seen(found: Attribution, gap: Gap) -> NDArray[np.bool_]:
    """Joints (n,) that move by themselves, or too little for a cause to be seen, and surely have none."""
    alone = found.prepared.by_itself | ~found.hypothesis.has_enough_samples
    if alone.any() and _verdict(found, gap) == "effect":
        for each in _named_effects(found)[1]:
            if each.probability >= UNSURE:
                alone[[joint for joint in (each.joint, each.into) if joint is not None]] = False
    return alone


def _named_effects(found: Attribution) -> tuple[list[int], tuple[NamedEffect, ...]]:
    """The effects that are reported, strongest first, and their places among the accepted ones."""
    named = [index for index, item in enumerate(found.accepted) if item.named]
    named.sort(key=lambda index: -found.accepted[index].score)
    return named, tuple(_named(found, index) for index in named)


def _without_doubtful(found: Attribution, supported: NDArray[np.bool_], sines: frozenset[int]) -> Attribution:
    """The attribution with effects no longer reported if left-out runs, a bound or their deviation say so.

    supported: (n,) of ``with_support``. sines: the joints that follow one sine.
    """
    accepted = list(with_support(found.accepted, supported))
    by_sines = bool(sines) and sines | found.prepared.still >= set(range(found.prepared.joints))
    for index, item in enumerate(accepted):
        if not item.named:
            continue
        why = ONE_SINE if by_sines else doubt(_named(found, index))
        if is_too_short(item, found.hypothesis.has_enough_samples):
            why = TOO_SHORT
        if why:
            accepted[index] = replace(item, named=False, doubt=why)
    return replace(found, accepted=tuple(accepted))


def _kept(
    only: tuple[Design, Fit],
    final: tuple[Design, Fit],
    at_rest: tuple[tuple[Array, ...], ...],
    torque: Array,
    with_effects: bool,
) -> tuple[Kept, NDArray[np.bool_], tuple[tuple[Array, ...], ...]]:
    """Shrinkage shares of the fitted changes, the joints that effects improve, and the held-out residuals.

    The joints: (n,), those that the effects predict better. The residuals: a run (M, n), of the model as
    given, re-identified, and with the effects, after shrinkage. at_rest: the same near rest, zero elsewhere.
    torque: (n,) N·m of the joints. with_effects: False where nothing is kept of them, since a log that counts
    otherwise than the model gives effects that stand for that.
    """
    first = only[0]
    nominal = tuple(np.where(used, gap, 0.0) for used, gap in zip(first.used, first.gap, strict=True))
    weights = 1 / np.maximum(torque, np.finfo(float).tiny) ** 2
    stages = nominal, only[1].held_out, final[1].held_out
    kept, supported = shares_kept(stages, at_rest, weights)
    if not with_effects:
        kept = kept.without_effects(np.ones_like(supported))
    each_run = zip(*stages, strict=True)
    parameters, effects = zip(*(kept.of_torque(*run) for run in each_run), strict=True)
    return kept, supported, (nominal, parameters, effects)


def _gap(prepared: Prepared, hypothesis: Design, left: Sequence[Sequence[Array]]) -> Gap:
    """Errors on runs held out. left: residuals by the model as given, re-identified, and with the effects."""
    nominal, parameters, effects = (rms(each, hypothesis) for each in left)
    of_noise = noise(prepared)
    floor = np.minimum(of_noise.rms, np.minimum(effects, parameters))
    intervals = np.array([rms_interval(prepared, residual) for residual in left])
    return Gap(nominal, parameters, effects, floor, intervals, ~of_noise.seen, above_band(prepared))


def _verdict(found: Attribution, gap: Gap) -> str:
    named = any(item.named for item in found.accepted)
    if found.unknown and not (named and _closes_more(found)):
        return "unknown"
    if named:
        return "effect"
    torque = _torque(found.prepared)
    better = (gap.nominal > gap.parameters * (1 + PARAMETERS_SHARE)) & (
        gap.nominal > PARAMETERS_TORQUE * torque
    )
    return "parameters" if np.any(better) else "none"


def _closes_more(found: Attribution) -> bool:
    """Whether some reported effect explains more than the unexplained residual, relative to joint torques.

    A residual that follows nothing is reported besides the effects, since no motion predicts it, unless it is
    far more; but where half the joints have it, a reported effect is a trace of it. A push leaves it where it
    acted otherwise than was fitted.
    """
    named = [item for item in found.accepted if item.named]
    nothing = {item.joint for item in found.unknown if item.regime == NOTHING}
    pushed = any(item.candidate.is_event for item in named)
    if not pushed and len(nothing) >= max(0.5 * found.prepared.joints, 2):
        return False
    before = rms(found.parameters_only[1].held_out, found.parameters_only[0]) / _torque(found.prepared)
    misfits = [
        (FAR_LESS if item.regime == NOTHING else 1.0) * item.share * before[item.joint] ** 2
        for item in found.unknown
        if item.regime != NOTHING or not (pushed or item.nearest)
    ]
    return max(item.worth for item in named) > max(misfits, default=0.0)


def _torque(prepared: Prepared) -> Array:
    return np.sqrt(np.mean(np.concatenate([run.torque for run in prepared.runs]) ** 2, axis=0))


def _named(found: Attribution, index: int) -> NamedEffect:
    accepted: Accepted = found.accepted[index]
    hypothesis, fitted = found.hypothesis, found.fitted
    part = hypothesis.parts[index]
    member, family = accepted.candidate.member, accepted.candidate.family
    covariance = covariance_with_shapes(hypothesis, fitted, index)
    return NamedEffect(
        effect=family.effect,
        joint=family.joint,
        into=family.into,
        probability=accepted.fault * accepted.probability,
        parameters=family.parameters(member, fitted.values[part], covariance),
        candidate=accepted.candidate,
        confusable_with=tuple(
            dict.fromkeys(
                rival.candidate.family.effect
                for rival, probability in accepted.rivals
                if probability > CONFUSABLE and rival.candidate.family.effect != family.effect
            )
        ),
        held_out_share=accepted.share,
    )


def _ranked(found: Attribution, told: Mapping[int, float]) -> tuple[RankedCandidate, ...]:
    """All candidates that were considered, most probable first.

    told: the probability of each effect that the verdict reports, by its place among the accepted ones.
    """
    ranked = []
    for index, accepted in enumerate(found.accepted):
        family = accepted.candidate.family
        suspected = accepted.fault * accepted.probability if accepted.is_suspected else 0.0
        ranked.append(
            RankedCandidate(
                effect=family.effect,
                joint=family.joint,
                into=family.into,
                probability=told.get(index, suspected),
                score=accepted.share,
                reason="" if index in told else _why_not_told(found, accepted),
            )
        )
        # Where a name is less certain, its rivals are as well.
        certain = told.get(index, accepted.probability) / accepted.probability
        for rival, probability in accepted.rivals:
            other = rival.candidate.family
            ranked.append(
                RankedCandidate(
                    other.effect,
                    other.joint,
                    other.into,
                    certain * probability,
                    rival.score,
                    f"less likely than {family.effect}",
                )
            )
    for weighed in found.last_stage[:10]:
        family = weighed.candidate.family
        ranked.append(
            RankedCandidate(family.effect, family.joint, family.into, 0.0, weighed.score, "not material here")
        )
    seen: dict[tuple, RankedCandidate] = {}
    for item in sorted(ranked, key=lambda r: -r.probability):
        seen.setdefault((item.effect, item.joint, item.into), item)
    return tuple(seen.values())


def _why_not_told(found: Attribution, item: Accepted) -> str:
    """Reason why an accepted effect is not reported in the verdict."""
    family = item.candidate.family
    if item.doubt:
        return item.doubt
    if item.named:
        return "beside a larger gap that has no name"
    if is_how_runs_begin(found.prepared, item.candidate):
        return "fitted, but only where runs begin, as brakes and friction that still hold are"
    if item.is_everywhere:
        return "fitted, but hardly larger than at other joints"
    if item.is_suspected:
        likely = f"a fault with {item.fault:.0%}, and stated from {STATED:.0%} on"
        return f"fitted, but healthy joints may have as much: {likely}"
    if (family.effect, family.joint) in {(each.nearest, each.joint) for each in found.unknown}:
        return "fitted, but leaves too much of the gap"
    if family.joint in {each.joint for each in found.unknown}:
        return "fitted, beside what no effect explains at its joint"
    return "fitted, but no more than healthy robots have or a law's rest"
