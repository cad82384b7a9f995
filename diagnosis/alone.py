"""What has a name where nothing else is seen: robots that are a little imperfect are so at every joint."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from testbench.robot import Robot

from .accepted import Accepted
from .healthy import BENDING, RIPPLE, SPRING, WARMING, times_healthy
from .hypothesis import DELAY
from .likelihood import Weighed
from .materiality import BEYOND
from .weighing import Stage

Array = NDArray[np.float64]

# Beside one that is alone nothing gains more than this share of what it does.
BESIDE_ALONE = 0.4
# Of these every joint of an imperfect robot has a little. One that gains this log-likelihood alone, and has
# so much of a healthy size, is no imperfection.
LEAST_ALONE = 40.0
OF_EVERY_JOINT: Mapping[str, float] = {**dict.fromkeys((SPRING, WARMING, BENDING), 0.3), RIPPLE: 0.5}
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
    """Whether what a stage has found is too much for a robot that has nothing else but what has a name.

    robot: that sizes are relative to. coefficients: (k,) as fitted in full. before: what was taken in; at its
    joint nothing may be. rest: what is left to explain.
    """
    family = best.candidate.family
    if family.effect == DELAY:
        return not before and is_late_alone(stage, rest)
    if family.effect not in OF_EVERY_JOINT or best.score < LEAST_ALONE or not is_most(best, rest):
        return False
    places = {place for each in before for place in (each.candidate.family.joint, each.candidate.family.into)}
    nameless = max((each.score for each in before if not each.named), default=0.0)
    if family.joint in places or nameless >= BESIDE_ALONE * best.score:
        return False
    times = times_healthy(robot, stage.ground.torque_rms, best.candidate, coefficients)
    return times > OF_EVERY_JOINT[family.effect]


def is_most(best: Weighed, rest: Sequence[Weighed]) -> bool:
    """Whether nothing beside it gains nearly as much. rest: what is left to explain."""
    return max((each.score for each in rest), default=0.0) < BESIDE_ALONE * best.score


def is_late_alone(stage: Stage, weighed: Sequence[Weighed]) -> bool:
    """Whether a robot without imperfections has its torque act later than the timing of any log has it.

    stage: without a delay. weighed: of all effects.
    """
    others = [each for each in weighed if each.candidate.family.effect != DELAY]
    if any(each.gain.wald > BY_CHANCE for each in others):
        return False
    timing = stage.hypothesis.timing
    deviation = float(np.sqrt(stage.fitted.covariance[timing, timing]))
    # What acts after the sample that reports it seems to be logged early.
    late = -stage.timing - BEYOND * deviation
    return late > max(LEAST_LATE, LATE_OF_SAMPLE * stage.prepared.sample_time)
