"""A found effect: the best of a round, its rivals, and whether its size is certain."""

from dataclasses import dataclass

from ..fit.likelihood import Weighed, gained_by_shift
from ..fit.linearisation import bends_parameters
from ..fit.normal_equations import Fit
from ..fit.score import Stage
from ..model.candidates import EVENT, SATURATION
from ..model.hypothesis import Design
from ..plausibility.materiality import SMALLEST_WALD

# Four standard deviations of an effect that shows in the parameters' shift, by this log-likelihood, which is
# evidence as well.
SWALLOWED_WALD, SWALLOWED_SHIFT = 16.0, 1.5
# A trace that left-out runs show is reported from four and a half standard deviations, with this share of
# some joint's residual: misfit and noise rarely reach it.
TRACE_WALD, SMALLEST_TRACE = 20.0, 0.025


@dataclass(frozen=True)
class Found:
    """The effect that a search round accepts, its rivals, and the hypothesis with it and its fit.

    is_trace: as of Accepted. is_last: any other trace found later is only a residual of this one.
    """

    best: Weighed
    rivals: tuple[tuple[Weighed, float], ...]
    trial: tuple[Design, Fit]
    is_trace: bool = False
    is_last: bool = False

    def is_certain(self, stage: Stage) -> bool:
        """Whether its size is known well enough to report it.

        Pushes and limits are judged where they are searched for.
        """
        family = self.best.candidate.family
        if family.effect in (EVENT, SATURATION):
            return True
        fitted, own = self.trial[1], slice(-self.best.candidate.count, None)
        wald = fitted.wald(own)
        if self.is_trace and not bends_parameters(family):
            return bool(wald > TRACE_WALD and stage.shares(self.best.gain).max() > SMALLEST_TRACE)
        if self.is_trace and self.best.candidate.count == 1:
            # What makes up for a misfit has another size without one run or another: by both variances' mean.
            by_folds = fitted.wald_by_folds(own)
            wald = 2 * wald * by_folds / (wald + by_folds)
        # All parameters' estimates speak for or against a trace.
        shifts = self.is_trace or gained_by_shift(stage, self.best.gain) > SWALLOWED_SHIFT
        return bool(wald > (SWALLOWED_WALD if family.swallowed and shifts else SMALLEST_WALD))
