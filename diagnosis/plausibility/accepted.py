"""Accepted effects, and rules on what several of them at one joint mean."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from testbench.effects.transmission_ripple import SLOWEST

from ..fit.likelihood import Weighed
from ..fit.normal_equations import Fit, fitted_to
from ..fit.score import Stage
from ..model.base_regressor import BaseRegressor
from ..model.candidate import Candidate
from ..model.hypothesis import Design
from ..residual.localisation import share_left
from ..residual.shares import Unclaimed


@dataclass(frozen=True)
class Accepted:
    """An accepted effect, with the rivals it was preferred to at its stage and their probabilities.

    score: log-likelihood that it added. share: of some joint's held-out squared residual, the largest. worth:
    mean squares that it took off the joints' residuals, each by its own torque, summed. shift: log-likelihood
    of the parameters' shift that it spares. named: whether it is larger than on any healthy robot.
    fault: the probability that it is a fault and no imperfection. is_everywhere: whether it is not reported
    because other joints have as much. is_suspected: whether only that probability speaks against reporting
    it. doubt: why it is no longer reported.
    """

    candidate: Candidate
    probability: float
    rivals: tuple[tuple[Weighed, float], ...]
    score: float
    share: float
    worth: float
    shift: float = 0.0
    named: bool = True
    fault: float = 1.0
    is_everywhere: bool = False
    is_suspected: bool = False
    doubt: str = ""

    @property
    def stated(self) -> float:
        """The probability that it is a fault, and this one among its rivals."""
        return self.fault * self.probability


def without_rests(accepted: Sequence[Accepted]) -> list[Accepted]:
    """The accepted effects without reported laws of position that only correct another one of their joint.

    No counterbalance is quite a sine: where one law explains nearly all, the others fit its residual.
    """
    return [item for item in accepted if not (item.named and is_rest(item, accepted))]


def is_rest(item: Accepted, accepted: Sequence[Accepted]) -> bool:
    """Whether it is a law of position at a joint that another reported one all but explains."""
    others = [a for a in accepted if a.named and _is_other_law(a, item)]
    all_but_all = (a.share > max(item.share, a.candidate.description.explains_all) for a in others)
    return _is_of_position(item) and any(all_but_all)


def laws_of_position(first: Stage, last: Stage, accepted: Sequence[Accepted]) -> tuple[Unclaimed, ...]:
    """Joints at which it takes two laws of position: together they are one that no catalogue holds.

    first: re-identification, without effects. last: with all accepted effects.
    """
    found, named = [], [a for a in accepted if a.named and _is_of_position(a)]
    for joint, left in enumerate(share_left(first, last).tolist()):
        laws = {a.candidate.family.effect for a in named if a.candidate.family.joint == joint}
        if len(laws) > 1:
            found.append(Unclaimed(joint, "position", 1 - left))
    return tuple(found)


def _is_of_position(item: Accepted) -> bool:
    """Whether it is a law of position, as a spring's, or a ripple too slow for the teeth of any gear."""
    slow = item.candidate.member.shape.get("cycles", np.inf) < SLOWEST
    return item.candidate.description.of_position or slow


def _is_other_law(one: Accepted, other: Accepted) -> bool:
    """Whether the first is a law of position, of another effect of the second's joint."""
    a, b = one.candidate.family, other.candidate.family
    return _is_of_position(one) and a.joint == b.joint and a.effect != b.effect


def without_one(base: BaseRegressor, accepted: Sequence[Accepted], place: int) -> tuple[Design, Fit]:
    """The hypothesis without one of its effects, fitted in full."""
    return fitted_to(base, [a.candidate for k, a in enumerate(accepted) if k != place])
