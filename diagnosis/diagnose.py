"""The whole diagnosis of a robot's logs: where, which, how far."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from recordings.checks.finding import Finding, barred_joints, barring
from testbench.log import Recording
from testbench.robot import Robot

from .correction.corrected_model import corrected_by
from .correction.residual_near_rest import left_at_rest
from .data.run import Prepared
from .data.single_sine import one_sine
from .decision.attribution import Attribution
from .decision.doubts import (
    IN_ANOTHER_UNIT,
    ONE_SINE,
    TOO_SHORT,
    acts_on,
    doubt,
    is_too_short,
    with_support,
    without_seconds,
)
from .decision.findings import Diagnosis, Gap, NamedEffect
from .decision.harmful_effects import without_misleading, without_undetermined
from .decision.held_out_check import closed_without_a_name
from .decision.ranking import named_effect, named_effects, ranked
from .decision.verdict import joint_torque, verdict_of
from .fit.normal_equations import Fit, rms
from .fit.torque_alignment import aligned
from .held_out.differing_runs import without_differences
from .held_out.prior_strength import with_predictive_prior
from .held_out.recurring_push import recurrence
from .held_out.shrinkage import Kept, everything, shares_kept
from .model.hypothesis import Design
from .report.sentence import UNSURE, sentence_of, unclaimed_in_words
from .residual.intervals import rms_interval
from .residual.localisation import where
from .residual.noise import noise
from .residual.spectrum import above_band
from .search.growth import attribute

Array = NDArray[np.float64]


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
    return diagnose_prepared(aligned(robot, recordings, cutoff), without, payloads, log_findings)


def diagnose_prepared(
    runs: Prepared,
    without: Sequence[str] = (),
    payloads: Mapping[str, float] | None = None,
    log_findings: tuple[Finding, ...] = (),
) -> Diagnosis:
    """The same of runs as ``aligned`` prepares them."""
    robot = runs.robot
    alike, differences = without_differences(runs, payloads)
    found = without_undetermined(attribute(alike, without))
    prepared, barred = found.prepared, barring(log_findings)
    only = found.parameters_only[0], with_predictive_prior(*found.parameters_only)
    found, (hypothesis, fitted) = without_misleading(found, only)
    final = hypothesis, with_predictive_prior(hypothesis, fitted)
    again = recurrence(*final)
    torque, sines = joint_torque(prepared), one_sine(prepared)
    at_rest = left_at_rest(prepared, corrected_by(only[1], final, again, everything(robot.joints)))
    kept, supported, left = _kept(only, final, at_rest, torque, barred is None)
    only, gap = (only[0], replace(only[1], held_out=left[1])), _gap(prepared, final[0], left)
    unit = frozenset(map(robot.joint_names.index, barred_joints(log_findings)))
    found = _without_doubtful(found, supported, sines, unit)
    found = _with_unnamed(found, gap, torque)
    found, kept, gap = _of_joints_that_move(found, kept, gap, supported, left)
    effects = named_effects(found)
    verdict, sentence = _said(found, gap, [effect for _, effect in effects], torque, barred)
    reported = effects if verdict == "effect" else []
    return Diagnosis(
        robot=robot,
        verdict=verdict,
        sentence=sentence,
        effects=tuple(effect for _, effect in reported),
        ranked=ranked(found, {place: effect.probability for place, effect in reported}),
        where=where(prepared, only, gap.noise_floor),
        gap=gap,
        prepared=prepared,
        parameters_only=only,
        final=final,
        kept=kept,
        not_observable=found.hidden,
        notes=tuple(unclaimed_in_words(robot, item) for item in found.unknown),
        recurrence=again,
        everywhere=tuple(a.candidate.place[:2] for a in found.accepted if a.is_everywhere),
        one_sine=sines,
        differences=differences,
        log_findings=log_findings,
    )


def _said(
    found: Attribution, gap: Gap, effects: Sequence[NamedEffect], torque: Array, barred: Finding | None
) -> tuple[str, str]:
    """The verdict, and the sentence that says it. barred: what must be mended in the logs first."""
    if barred is not None:
        # With such a gap, any reported effect stands for a part of it.
        stop = "" if barred.sentence.endswith("?") else "."
        return "unknown", f"{barred.sentence}{stop} Mend that first: beside it no effect is named."
    verdict = verdict_of(found, gap)
    return verdict, sentence_of(found.prepared.robot, verdict, effects, found.unknown, gap, torque)


def _with_unnamed(found: Attribution, gap: Gap, torque: Array) -> Attribution:
    """The attribution with joints unknown whose gap is closed by effects that are not reported.

    torque: (n,) N·m of the joints.
    """
    known = {each.joint for each in found.unknown}
    unnamed = [each for each in closed_without_a_name(found.accepted, gap, torque) if each.joint not in known]
    return replace(found, unknown=(*found.unknown, *unnamed))


def _of_joints_that_move(
    found: Attribution,
    kept: Kept,
    gap: Gap,
    supported: NDArray[np.bool_],
    left: tuple[tuple[Array, ...], ...],
) -> tuple[Attribution, Kept, Gap]:
    """All three without the effects of joints that move by themselves or too little, and surely have none.

    What other joints' motion would make of them was never seen. supported, left: of ``_kept``.
    """
    alone = _hardly_seen(found, gap)
    if not (alone.any() and kept.effects[alone].any()):
        return found, kept, gap
    found = replace(found, accepted=with_support(found.accepted, supported & ~alone))
    effects_left = tuple(np.where(alone, a, b) for a, b in zip(left[1], left[2], strict=True))
    gap = _gap(found.prepared, found.hypothesis, (left[0], left[1], effects_left))
    return found, kept.without_effects(alone), gap


def _hardly_seen(found: Attribution, gap: Gap) -> NDArray[np.bool_]:
    """Joints (n,) that move by themselves, or too little for a cause to be seen, and surely have none."""
    alone = found.prepared.by_itself | ~found.hypothesis.has_enough_samples
    if alone.any() and verdict_of(found, gap) == "effect":
        for _, each in named_effects(found):
            if each.probability >= UNSURE:
                alone[[joint for joint in (each.joint, each.into) if joint is not None]] = False
    return alone


def _without_doubtful(
    found: Attribution, supported: NDArray[np.bool_], sines: frozenset[int], unit: frozenset[int]
) -> Attribution:
    """The attribution with effects no longer reported if left-out runs, a bound, their deviation or a larger
    effect of their joint say so.

    supported: (n,) of ``with_support``. sines: the joints that follow one sine. unit: those whose torque may
    be in another unit.
    """
    accepted = list(with_support(found.accepted, supported))
    by_sines = bool(sines) and sines | found.prepared.still >= set(range(found.prepared.joints))
    for index, item in enumerate(accepted):
        if not item.named:
            continue
        why = ONE_SINE if by_sines else doubt(named_effect(found, index))
        if is_too_short(item, found.hypothesis.has_enough_samples):
            why = TOO_SHORT
        if acts_on(item, unit):
            why = IN_ANOTHER_UNIT
        if why:
            accepted[index] = replace(item, named=False, doubt=why)
    return replace(found, accepted=without_seconds(accepted))


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
    of_noise = noise(hypothesis.base)
    floor = np.minimum(of_noise.rms, np.minimum(effects, parameters))
    intervals = np.array([rms_interval(prepared, residual) for residual in left])
    return Gap(nominal, parameters, effects, floor, intervals, ~of_noise.seen, above_band(prepared))
