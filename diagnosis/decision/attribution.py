"""An attribution: the hypothesis that a search found, with the candidates that it did not accept."""

from dataclasses import dataclass

from ..data.run import Prepared
from ..fit.likelihood import Weighed
from ..fit.normal_equations import Fit
from ..model.hypothesis import Design
from ..plausibility.accepted import Accepted
from ..residual.shares import Unclaimed


@dataclass(frozen=True)
class Attribution:
    """The hypothesis found.

    unknown: structure that no effect explains. last_stage: candidates not accepted. hidden: effects that
    would not show in these runs.
    """

    prepared: Prepared
    accepted: tuple[Accepted, ...]
    hypothesis: Design
    fitted: Fit
    parameters_only: tuple[Design, Fit]
    unknown: tuple[Unclaimed, ...]
    last_stage: tuple[Weighed, ...]
    hidden: tuple[tuple[str, int | None], ...]

    def takes_in(self, name: str, joint: int) -> bool:
        """Whether an effect at this joint is among the accepted ones."""
        return (name, joint) in [item.candidate.place[:2] for item in self.accepted]
