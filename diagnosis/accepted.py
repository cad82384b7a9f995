"""An effect that was taken in, and what several of them say together."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .candidates import Candidate
from .healthy import SPRINGS
from .likelihood import Weighed
from .unclaimed import Unclaimed
from .weighing import Stage

# Cycles a revolution.
SLOWEST_RIPPLE = 10.0


@dataclass(frozen=True)
class Accepted:
    """An effect taken in, with the rivals it was preferred to at its stage and their probabilities.

    score: log-likelihood that it added. share: of some joint's held-out squared residual, the largest. worth:
    mean squares that it took off the joints' residuals, each by its own torque, summed. shift: log-likelihood
    of the parameters' shift that it spares. named: whether it is larger than on any healthy robot.
    is_certain: whether its size is known well enough for that. is_trace: found by a trace that only shows
    beside every joint's imperfections, or where there are none. is_everywhere: whether other joints are about
    as imperfect, so that it has no name.
    """

    candidate: Candidate
    probability: float
    rivals: tuple[tuple[Weighed, float], ...]
    score: float
    share: float
    worth: float
    shift: float = 0.0
    named: bool = True
    is_certain: bool = True
    is_trace: bool = False
    is_everywhere: bool = False


def laws_of_position(first: Stage, last: Stage, accepted: Sequence[Accepted]) -> tuple[Unclaimed, ...]:
    """Joints at which it takes two laws of position: together they are one that no catalogue holds.

    first: re-identification alone. last: with all effects taken in.
    """
    found = []
    for joint in range(first.prepared.joints):
        laws = [a for a in accepted if a.named and a.candidate.family.joint == joint and _is_of_position(a)]
        if len({item.candidate.family.effect for item in laws}) > 1:
            share = 1 - float(last.held_squares[joint] / max(float(first.held_squares[joint]), 1e-300))
            found.append(Unclaimed(joint, "position", share))
    return tuple(found)


def _is_of_position(item: Accepted) -> bool:
    """A spring, or a ripple too slow for the teeth of any gear."""
    slow = item.candidate.member.shape.get("cycles", np.inf) < SLOWEST_RIPPLE
    return item.candidate.family.effect in SPRINGS or slow
