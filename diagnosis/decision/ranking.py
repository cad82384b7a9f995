"""The reported effects of an attribution with their parameters, and all candidates ranked, with reasons."""

from collections.abc import Mapping

from ..fit.shape_covariance import covariance_with_shapes
from ..model.candidate import Candidate
from ..plausibility.accepted import Accepted
from .attribution import Attribution
from .findings import NamedEffect, RankedCandidate
from .probability import STATED
from .reported_effects import CONFUSABLE, is_how_runs_begin

# So many candidates that were never accepted are listed.
LISTED = 10


def named_effects(found: Attribution) -> list[tuple[int, NamedEffect]]:
    """The effects that are reported, strongest first, each with its place among the accepted ones."""
    named = [index for index, item in enumerate(found.accepted) if item.named]
    named.sort(key=lambda index: -found.accepted[index].score)
    return [(index, named_effect(found, index)) for index in named]


def named_effect(found: Attribution, index: int) -> NamedEffect:
    """One accepted effect, by its place, with its parameters and their deviations."""
    accepted: Accepted = found.accepted[index]
    hypothesis, fitted = found.hypothesis, found.fitted
    part = hypothesis.parts[index]
    member, family = accepted.candidate.member, accepted.candidate.family
    covariance = covariance_with_shapes(hypothesis, fitted, index)
    return NamedEffect(
        effect=family.effect,
        joint=family.joint,
        into=family.into,
        probability=accepted.stated,
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


def ranked(found: Attribution, reported: Mapping[int, float]) -> tuple[RankedCandidate, ...]:
    """All candidates that were considered, most probable first.

    reported: the probability of each effect that the verdict reports, by its place among the accepted ones.
    """
    considered = []
    for index, accepted in enumerate(found.accepted):
        family = accepted.candidate.family
        suspected = accepted.stated if accepted.is_suspected else 0.0
        reason = "" if index in reported else _why_not_reported(found, accepted)
        probability = reported.get(index, suspected)
        considered.append(_candidate(accepted.candidate, probability, accepted.share, reason))
        # Where a name is less certain, its rivals are as well.
        certain = reported.get(index, accepted.probability) / accepted.probability
        for rival, among in accepted.rivals:
            less = f"less likely than {family.effect}"
            considered.append(_candidate(rival.candidate, certain * among, rival.score, less))
    for weighed in found.last_stage[:LISTED]:
        considered.append(_candidate(weighed.candidate, 0.0, weighed.score, "not material here"))
    seen: dict[tuple, RankedCandidate] = {}
    for item in sorted(considered, key=lambda each: -each.probability):
        seen.setdefault((item.effect, item.joint, item.into), item)
    return tuple(seen.values())


def _candidate(candidate: Candidate, probability: float, score: float, reason: str) -> RankedCandidate:
    family = candidate.family
    return RankedCandidate(family.effect, family.joint, family.into, probability, score, reason)


def _why_not_reported(found: Attribution, item: Accepted) -> str:
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
    if family.joint in {each.joint for each in found.unknown}:
        return "fitted, beside what no effect explains at its joint"
    return "fitted, but no more than healthy robots have or a law's rest"
