"""A hypothesis while it grows: its stage, the effects that it has, and the candidates that may be next."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from testbench.robot import Robot

from ..fit.likelihood import Weighed
from ..fit.score import Stage
from ..model.base_regressor import BaseRegressor
from ..model.candidate import Candidate
from ..model.gram import Bank
from ..model.hypothesis import Design
from ..plausibility.accepted import Accepted
from ..proposals.low_speed_friction import lead_candidates, soft_candidates


@dataclass(frozen=True)
class Banks:
    """Candidates along the runs: the catalogue's, free functions of the motion, friction near rest.

    ahead, soft: of friction ahead of the joint, and of smooth friction.
    """

    proposals: Bank
    free: Bank
    ahead: Bank
    soft: Bank

    @staticmethod
    def beside(proposals: Bank, base: BaseRegressor, motions: Sequence[Candidate]) -> "Banks":
        """The bank of the catalogue with the others. motions: free functions of the motion."""
        others = motions, lead_candidates(base.prepared), soft_candidates(base.prepared)
        return Banks(proposals, *(Bank(base, each) for each in others))


@dataclass(frozen=True)
class Grown:
    """A hypothesis as far as it is grown.

    original: re-identification, without effects. sized: the robot that sizes are relative to. stage: with all
    accepted effects. weighed: candidates that are not accepted, best first. banks: None while they are to be
    made anew.
    """

    original: Stage
    sized: Robot
    stage: Stage
    accepted: tuple[Accepted, ...]
    weighed: tuple[Weighed, ...]
    banks: Banks | None


def as_of(hypothesis: Design, accepted: Sequence[Accepted]) -> list[Accepted]:
    """The accepted effects, each with the hypothesis' own candidate in place of its own."""
    return [replace(a, candidate=c) for a, c in zip(accepted, hypothesis.accepted, strict=True)]
