"""What re-identification swallows, looked for once every joint's imperfections are fitted beside it.

A gain error, an offset of an encoder, a payload or a spring leaves a small trace in what is left; any
robot's own imperfections leave larger ones, which would hide it or be taken for it.
"""

from collections.abc import Sequence

import numpy as np

from .candidates import Candidate
from .evidence import fitted_to
from .likelihood import Weighed, gained_by_joint, weigh
from .weighing import Bank, Stage

# What any joint has a little of, and what is fitted beside: friction, ripple, cables.
IMPERFECTIONS = (
    "stribeck_friction",
    "asymmetric_friction",
    "nonlinear_viscous_friction",
    "load_dependent_friction",
    "presliding_hysteresis",
    "transmission_ripple",
    "cable_spring",
)
# Log-likelihood from which an imperfection is worth fitting beside, and that a trace must gain.
BESIDE, SMALLEST_GAIN = 4.0, 9.0


def swallowed(
    stage: Stage, accepted: Sequence[Candidate], weighed: Sequence[Weighed]
) -> tuple[Stage, list[Weighed]]:
    """The stage with one imperfection a joint fitted beside, and the swallowed effects that show there.

    Best first. accepted: the effects of the stage. weighed: all others there, best first.
    """
    beside: dict[int, Candidate] = {}
    for each in weighed:
        joint = each.candidate.family.joint
        if joint is not None and each.candidate.family.effect in IMPERFECTIONS and each.score > BESIDE:
            beside.setdefault(joint, each.candidate)
    after = Stage(stage.ground, *fitted_to(stage.prepared, [*accepted, *beside.values()]))
    hidden = [each.candidate for each in weighed if each.candidate.family.swallowed]
    found = weigh(after, Bank(stage.ground, hidden)) if hidden else []
    return after, [each for each in found if _without_others(after, each) > SMALLEST_GAIN]


def _without_others(stage: Stage, weighed: Weighed) -> float:
    """What is left of the score without the joint that gains most, of those that the effect does not load.

    Parameters moved by an effect may happen to suit another joint's misfit.
    """
    others = np.delete(gained_by_joint(stage, weighed.gain), list(weighed.candidate.member.rows))
    return weighed.score - float(np.max(others, initial=0.0))
