"""Conclusion of a search: effects that no longer count taken out, the rest judged, what is left described."""

from collections.abc import Sequence
from dataclasses import replace

from testbench.robot import Robot

from ..decision.attribution import Attribution
from ..decision.reported_effects import as_fitted_at_last, likely_faults
from ..fit.likeliest_shapes import after_a_step, at_likeliest_shapes
from ..fit.likelihood import Weighed, gained, weigh
from ..fit.normal_equations import Fit, fitted_to
from ..fit.score import Stage
from ..model.base_regressor import BaseRegressor
from ..model.candidate import SATURATION
from ..model.hypothesis import Design
from ..model.library import Library
from ..plausibility.accepted import Accepted, laws_of_position, without_one, without_rests
from ..plausibility.materiality import is_material
from ..plausibility.observability import not_observable
from ..proposals.flat_top import flat_tops
from ..proposals.vibration import vibrations, with_its_line, without_shaken, worth_reporting
from ..residual.shares import NOTHING, Unclaimed
from ..residual.unexplained import unclaimed, with_its_period
from .grown import Grown, as_of

# Patterns in what effects explain or leave that no effect of the catalogue makes.
IMITATIONS = (laws_of_position, vibrations)


def concluded(grown: Grown, library: Library) -> Attribution:
    """The attribution that a grown hypothesis comes to.

    Effects that are not material with all others fitted are taken out; the others are judged with all of them
    fitted, and again at their final shapes.
    """
    assert grown.banks is not None
    original, sized, base = grown.original, grown.sized, grown.stage.base
    accepted, hypothesis, fitted = _kept(grown, library)
    unchanged = hypothesis is grown.stage.hypothesis
    last = grown.stage if unchanged else Stage(hypothesis, fitted)
    taken = {item.candidate.place for item in accepted}
    open_ = [w for w in weigh(last, grown.banks.proposals) if w.candidate.place not in taken]
    accepted = likely_faults(sized, hypothesis, fitted, accepted, open_)
    imitated = [each for kind in IMITATIONS for each in kind(original, last, accepted)]
    if len(kept := without_shaken(accepted, imitated)) < len(accepted):
        accepted = kept
        hypothesis, fitted = fitted_to(base, [a.candidate for a in accepted])
    hypothesis, fitted = at_likeliest_shapes(sized, hypothesis, fitted)
    named = [place for place, item in enumerate(accepted) if item.named]
    hypothesis, fitted = after_a_step(sized, hypothesis, fitted, named)
    accepted = as_fitted_at_last(sized, hypothesis, fitted, accepted)
    accepted = likely_faults(sized, hypothesis, fitted, accepted, open_)
    names = {j for a in accepted if a.named and (j := a.candidate.family.joint) is not None}
    misfits = _like_nothing(last, unclaimed(original, last, grown.banks.free, names), imitated)
    unknown = (*misfits, *worth_reporting(imitated))
    open_at = {each.joint for each in unknown}
    reported = (replace(a, named=a.named and a.candidate.family.joint not in open_at) for a in accepted)
    return Attribution(
        base.prepared,
        tuple(reported),
        hypothesis,
        fitted,
        (original.hypothesis, original.fitted),
        unknown,
        grown.weighed,
        not_observable(sized, open_),
    )


def _kept(grown: Grown, library: Library) -> tuple[list[Accepted], Design, Fit]:
    """The effects that are still material with all fitted, without rests of others, with reported limits."""
    stage, sized = grown.stage, grown.sized
    accepted, hypothesis, fitted = _pruned(stage.base, sized, grown.accepted, stage.hypothesis, stage.fitted)
    if len(kept := without_rests(accepted)) < len(accepted):
        # What was shaped beside a rest of its own is not as it is alone.
        refitted = fitted_to(stage.base, [a.candidate for a in kept])
        hypothesis, fitted = at_likeliest_shapes(sized, *refitted)
        accepted = as_of(hypothesis, kept)
    if SATURATION not in library.without:
        accepted, hypothesis, fitted = _with_flat_tops(accepted, hypothesis, fitted)
    return accepted, hypothesis, fitted


def _like_nothing(last: Stage, left: Sequence[Unclaimed], imitated: Sequence[Unclaimed]) -> list[Unclaimed]:
    """Unexplained residuals, each with its line or period; none where a named pattern describes it."""
    misfits = [with_its_period(last, with_its_line(last, each)) for each in left]
    alike = {each.joint for each in imitated}
    return [each for each in misfits if each.regime != NOTHING or each.joint not in alike]


def _with_flat_tops(
    accepted: Sequence[Accepted], hypothesis: Design, fitted: Fit
) -> tuple[list[Accepted], Design, Fit]:
    """The hypothesis with the limits of drives that report what they gave, which explain nothing here."""
    known = [a.candidate.family.joint for a in accepted if a.candidate.family.effect == SATURATION]
    found = flat_tops(hypothesis.prepared, known)
    if not found:
        return list(accepted), hypothesis, fitted
    trial = fitted_to(hypothesis.base, [*hypothesis.accepted, *found])
    seen = [Accepted(each, probability=1.0, rivals=(), score=0.0, share=0.0, worth=0.0) for each in found]
    return [*accepted, *seen], *trial


def _pruned(
    base: BaseRegressor, sized: Robot, accepted: Sequence[Accepted], hypothesis: Design, fitted: Fit
) -> tuple[list[Accepted], Design, Fit]:
    """Take out, one by one, effects that are no longer material with the others fitted."""
    accepted = list(accepted)
    while len(accepted) > 1:
        rest = [without_one(base, accepted, place) for place in range(len(accepted))]
        worth = []
        for item, trial in zip(accepted, rest, strict=True):
            stage = Stage(*trial)
            gain = stage.gain(item.candidate)
            if gain is not None:
                # Both are fitted in full here, so what leaving it out costs is known exactly.
                gain = stage.as_fitted(gain, (hypothesis, fitted))
            # The timing of the log makes up for all that a delay explains.
            is_late = item.named and item.candidate.is_common_delay
            kept = item.candidate.is_event or is_late
            weighed = None if gain is None else Weighed(gain, gained(stage, gain))
            keeps = kept or (weighed is not None and is_material(sized, stage, weighed))
            worth.append((keeps, 0.0 if weighed is None else weighed.score))
        weakest = min(range(len(worth)), key=lambda k: (worth[k][0], worth[k][1]))
        if worth[weakest][0]:
            break
        accepted = [a for k, a in enumerate(accepted) if k != weakest]
        hypothesis, fitted = rest[weakest]
    return accepted, hypothesis, fitted
