"""Sentences of the report that state the verdict, the effects and the unexplained residual."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from testbench.robot import Robot

from ..decision.findings import LITTLE_CLOSED, PERHAPS_NOISE, Gap, NamedEffect
from ..residual.shares import NOTHING, UNCERTAIN, Unclaimed
from .words import LEAST_SHOWN

Array = NDArray[np.float64]

# Of each joint's torque: a model that predicts left-out runs to this explains them.
LITTLE_OF_TORQUE = 0.05
# A reported effect below this probability is as likely as not.
UNSURE = 0.6


def sentence_of(
    robot: Robot,
    verdict: str,
    effects: Sequence[NamedEffect],
    unknown: Sequence[Unclaimed],
    gap: Gap,
    torque: Array,
) -> str:
    """The verdict in one sentence. effects, unknown: reported effects and unexplained residuals, most first.

    torque: (n,) N·m RMS of the joints.
    """
    if verdict == "none":
        left = left_in_words(robot, gap.nominal, gap, torque)
        return f"The model predicts these logs as well as one re-identified from them, and {left}."
    if verdict == "parameters":
        left = left_in_words(robot, gap.parameters, gap, torque)
        return f"Other parameters than the model's are all that is found: re-identified, it {left}."
    if verdict == "unknown":
        return f"At {unclaimed_in_words(robot, unknown[0])}."
    parts = [_named_in_words(robot, effect) for effect in effects]
    if not any(effect.candidate.shows for effect in effects):
        # A drive that reports what it gave: see flat_top.py.
        named = ", ".join(parts)
        return f"There is {named}: along the measured motion it leaves no gap, in closed loop it does."
    return f"The gap comes from {', '.join(parts)}; {shrunk_in_words(robot, effects[0].joint, gap)}."


def left_in_words(robot: Robot, left: Array, gap: Gap, torque: Array) -> str:
    """How well a model predicts left-out runs: to the noise, to a share of the torque, or what is left where.

    left: (n,) N·m RMS, its error on runs left out.
    """
    share = np.divide(left, torque, out=np.zeros_like(left), where=torque > 0)
    worst = int(np.argmax(share))
    if np.all(left <= PERHAPS_NOISE * gap.noise_floor):
        return "explains them to the noise"
    if share[worst] <= LITTLE_OF_TORQUE:
        return f"explains them to {share[worst]:.1%} of each joint's torque"
    times = left[worst] / max(gap.noise_floor[worst], float(np.finfo(float).tiny))
    beyond = f"{'at least ' if gap.unseen[worst] else ''}{times:.2g} times the noise"
    of_torque = f"{share[worst]:.0%} of the torque of {robot.joint_names[worst]}"
    return f"leaves {of_torque} on runs left out, {beyond}, without a named cause"


def _named_in_words(robot: Robot, effect: NamedEffect) -> str:
    """An effect and its joint; with what may be in its place, or a perhaps, where it is as likely as not."""
    place = "" if effect.joint is None else f" at {robot.joint_names[effect.joint]}"
    name = effect.effect
    if effect.probability < UNSURE:
        name = " or ".join((name, *effect.confusable_with)) if effect.confusable_with else f"perhaps {name}"
    return f"{name.replace('_', ' ')}{place}"


def shrunk_in_words(robot: Robot, joint: int | None, gap: Gap) -> str:
    """How far the effects shrink the gap; joint: that of the first."""
    closed, place = gap.reported_closed, ""
    little = gap.closed is None or gap.closed < LITTLE_CLOSED
    if little and joint is not None and (own := gap.closed_at(joint)) is not None and own >= LITTLE_CLOSED:
        # Most of all joints' torque may be another's, whose parameters predict one run better than another.
        closed, place = own, f" at {robot.joint_names[joint]}"
    if closed is None:
        return "re-identified parameters leave little but noise along these motions"
    if closed <= 0:
        return "on runs left out it explains no more than re-identified parameters do"
    return f"it explains {closed:.0%} of what re-identified parameters leave{place} above the noise"


def unclaimed_in_words(robot: Robot, item: Unclaimed) -> str:
    """Phrase on a residual that no effect explains: its joint, what it follows, and a likely cause."""
    if item.regime == NOTHING and item.share < LEAST_SHOWN:
        # It shows in the parameters alone.
        joint = robot.joint_names[item.joint]
        return f"{joint} the parameters are not the model's, by what no effect of the catalogue makes of them"
    if item.regime == UNCERTAIN:
        return f"{robot.joint_names[item.joint]} {item.share:.0%} of the gap follows {UNCERTAIN}"
    followed, likely = item.regime if item.regime == NOTHING else f"the joint's {item.regime}", ""
    if item.period is not None:
        followed = f"the joint's {item.period}"
    if item.frequency is not None:
        followed = f"a vibration at {item.frequency:.1f} Hz"
        likely = ": a floor or a fan that shakes it would, or a load that swings"
    place = f"{robot.joint_names[item.joint]} {item.share:.0%} of the gap follows {followed}"
    return f"{place}, and no effect of the catalogue explains it{likely}"
