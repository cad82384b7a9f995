"""Reporting of an effect that is the only one seen: small imperfections would show at every joint."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from testbench.robot import Robot

from ..fit.likelihood import Weighed, gained_by_joint
from ..fit.score import Stage
from ..model.effect_sizes import BENDING, CABLE, GAIN, RIPPLE, SPRING, WARMING, times_healthy
from .accepted import Accepted
from .materiality import BEYOND, SMALLEST_WALD

Array = NDArray[np.float64]

# Beside one that is alone nothing gains more than this share of what it does, and there is nothing certain at
# more other joints than so many, and than half of them.
BESIDE_ALONE, MOST_JOINTS = 0.4, 2
# An effect of the whole robot is elsewhere if so much of what it gains is.
MOSTLY = 0.8
# Of these every joint of an imperfect robot has a little. One that gains this log-likelihood alone, and has
# so much of a healthy size, is no imperfection.
LEAST_ALONE = 40.0
OF_EVERY_JOINT: Mapping[str, float] = {
    **dict.fromkeys((SPRING, BENDING), 0.3),
    **dict.fromkeys((RIPPLE, GAIN), 0.5),
    "asymmetric_friction": 0.45,
    WARMING: 0.7,
    # A dress pack may pull at one joint alone.
    CABLE: 0.6,
}
# First moments that are not quite the model's look like springs of up to half of that, which explain less
# than this share of what is left.
SPRING_SIZE, SPRING_SHARE = 0.6, 0.4
# Torque that acts later than this, s, and than this share of a sample, for which a drive may hold it, is
# delayed where nothing else is seen at any joint: of some thousand shapes chance gives the best four standard
# deviations or less, and an imperfect robot more.
LEAST_LATE, LATE_OF_SAMPLE, BY_CHANCE = 1e-3, 0.6, 20.0


def is_alone(
    robot: Robot,
    stage: Stage,
    best: Weighed,
    coefficients: Array,
    before: Sequence[Accepted],
    rest: Sequence[Weighed],
) -> bool:
    """Whether an effect that no other unreported one comes near is too large to be an imperfection.

    robot: that sizes are relative to. coefficients: (k,) as fitted in full. before: accepted effects;
    none may be at its joint. rest: candidates for what is left to explain.
    """
    if best.candidate.is_common_delay:
        return are_joints_own(before) and is_late_alone(stage, rest)
    if not is_enough_alone(robot, stage, best, coefficients) or not is_most(best, rest):
        return False
    nameless = max((each.score for each in before if not each.named), default=0.0)
    return is_elsewhere(stage, best, before) and nameless < BESIDE_ALONE * best.score


def is_enough_alone(robot: Robot, stage: Stage, best: Weighed, coefficients: Array) -> bool:
    """Whether an effect of which every joint has a little is larger than a mere imperfection."""
    effect = best.candidate.family.effect
    if effect not in OF_EVERY_JOINT or best.score < LEAST_ALONE:
        return False
    times = times_healthy(robot, stage.ground.torque_rms, best.candidate, coefficients)
    if effect == SPRING and float(stage.shares(best.gain).max()) < SPRING_SHARE:
        return times > SPRING_SIZE
    return times > OF_EVERY_JOINT[effect]


def are_joints_own(before: Sequence[Accepted]) -> bool:
    """Whether all accepted effects are reported and of one joint; others may leave a residual anywhere."""
    return all(
        each.named and each.candidate.family.joint is not None and not each.candidate.is_event
        for each in before
    )


def is_elsewhere(stage: Stage, best: Weighed, before: Sequence[Accepted]) -> bool:
    """Whether no accepted effect is at its joints or, for the whole robot, where it gains most."""
    taken = {place for each in before for place in (each.candidate.family.joint, each.candidate.family.into)}
    family = best.candidate.family
    if not before:
        return True
    if family.joint is None:
        rest = np.delete(gained_by_joint(stage, best.gain), [joint for joint in taken if joint is not None])
        return float(rest.sum()) > MOSTLY * best.score
    return family.joint not in taken and (family.into is None or family.into not in taken)


def is_most(best: Weighed, rest: Sequence[Weighed]) -> bool:
    """Whether no other effect gains nearly as much, nor do most joints have some significant one.

    rest: candidates for what is left to explain.
    """
    joints = {w.candidate.family.joint for w in rest if w.gain.wald > SMALLEST_WALD and w.score > 0}
    if len(joints - {None, best.candidate.family.joint}) > min(MOST_JOINTS, (best.candidate.joints - 1) // 2):
        return False
    return max((each.score for each in rest), default=0.0) < BESIDE_ALONE * best.score


def is_late_alone(stage: Stage, rest: Sequence[Weighed]) -> bool:
    """Whether a robot without imperfections has its torque act later than the timing of any log has it.

    stage: without a delay. rest: what is left to explain beside the timing, or beside it.
    """
    if any(each.gain.wald > BY_CHANCE for each in rest):
        return False
    timing = stage.hypothesis.timing
    deviation = float(np.sqrt(stage.fitted.covariance[timing, timing]))
    # What acts after the sample that reports it seems to be logged early.
    late = -stage.timing - BEYOND * deviation
    return late > max(LEAST_LATE, LATE_OF_SAMPLE * stage.prepared.sample_time)
