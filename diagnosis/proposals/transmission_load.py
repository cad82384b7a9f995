"""Plays and soft gearboxes at the load that they carry: linearised anew until neither moves the other.

What the motor's motion makes of the link's is known by what the link loads the gearbox with, and that by
parameters that are fitted beside it: near a resonance a little of the one is much of the other.
"""

import numpy as np

from testbench.robot import Robot

from ..fit.likelihood import Weighed, gained, log_posterior
from ..fit.linearisation import linearised_anew
from ..fit.normal_equations import Fit, fitted_to
from ..fit.score import Stage
from ..model.hypothesis import Design
from .laws import MORE_TRIED, refined

# What the log-posterior of all runs together moves by where the runs are linearised anew, once they have
# settled; and how often they are, at most.
SETTLED, MOST_PASSES = 5.0, 5


def linearised_until_settled(robot: Robot, hypothesis: Design, fitted: Fit) -> tuple[Design, Fit]:
    """The hypothesis with the runs linearised anew, its plays and soft gearboxes as they are there; its fit.

    robot: that sizes are relative to.
    """
    best = linearised = linearised_anew(hypothesis, fitted)
    if not any(each.description.of_transmission for each in hypothesis.accepted):
        return best
    before, most = log_posterior(hypothesis, fitted), -np.inf
    for _ in range(MOST_PASSES):
        if abs(log_posterior(*linearised) - before) < SETTLED:
            break
        there = refined_again(robot, *linearised)
        before = log_posterior(*there)
        if before < most + SETTLED:
            break
        best, most, linearised = there, before, linearised_anew(*there)
    return best


def refined_again(robot: Robot, hypothesis: Design, fitted: Fit) -> tuple[Design, Fit]:
    """The hypothesis with the shapes of its backlash and soft gearboxes searched for anew; and its fit."""
    base = hypothesis.base
    for place, each in enumerate(hypothesis.accepted):
        if not each.description.of_transmission:
            continue
        others = [*hypothesis.accepted[:place], *hypothesis.accepted[place + 1 :]]
        stage = Stage.of(base, others)
        gain = stage.gain(each)
        # A link that never leaves the end of a gap there shows none.
        if gain is not None:
            best = refined(robot, stage, Weighed(gain, gained(stage, gain)), MORE_TRIED).candidate
            accepted = [*hypothesis.accepted[:place], best, *hypothesis.accepted[place + 1 :]]
            hypothesis, fitted = fitted_to(base, accepted)
    return hypothesis, fitted
