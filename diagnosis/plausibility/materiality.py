"""Material effects, worth accepting: statistical significance would be a false alarm on any healthy robot.

An effect matters when it explains a fair part of some joint's error on runs left out and of its torque, or,
where re-identified parameters absorb it, when it spares them a shift that CAD does not explain. It is
reported when it is also larger than what every healthy robot has.
"""

import numpy as np
from numpy.typing import NDArray

from testbench.robot import Robot

from ..fit.likelihood import Weighed, by_chance, gained, gained_by_shift, gained_elsewhere
from ..fit.linearisation import TRANSMISSIONS
from ..fit.score import Gain, Stage
from ..model.candidates import DELAY, Candidate
from ..model.effect_sizes import (
    BENDING,
    ECCENTRICITY,
    ELASTIC,
    OF_THE_LOAD,
    OFFSET,
    SPRING,
    is_beyond_healthy,
)
from ..model.hypothesis import LATE

Array = NDArray[np.float64]

# Share of a joint's held-out squared residual, and of its RMS torque, that an effect must explain ...
SMALLEST_SHARE = 0.10
SMALLEST_TORQUE = 0.005
# ... or the log-likelihood of the parameters' shift that it must spare, where it is absorbed by them and has
# one coefficient or two.
SMALLEST_SHIFT = 7.5
# A gravity spring's is that of the first moments of all links beyond its joint: errors of several add up.
SPRING_SHIFT = 12.0
# And what must be left of that with what it does to runs left out.
SMALLEST_SUM = 6.0
HIDDEN_OVERLAP = 0.9
# Friction that differs by direction, and no more, is any torque sensor's offset: it must show, by this share
# of what is left, or be so many times what healthy joints have.
OF_SENSORS, OF_SENSORS_SHARE, OF_SENSORS_SIZE = "asymmetric_friction", 0.02, 1.6
# What one joint's misfit can imitate is no effect of the whole robot.
SMALLEST_ELSEWHERE = 7.5
# Wald statistic of a reported effect: five standard deviations.
SMALLEST_WALD = 25.0
# Friction that its joint's own parameters absorb leaves little, however large it is, and a delay leaves a
# little at every joint: the size decides, where so many standard deviations less of it are still beyond a
# healthy robot's.
SWALLOWED_FRICTION = (OF_THE_LOAD, "asymmetric_friction")
# Play and a soft gearbox show in reversals and vibrations alone, which are a small part of a run: no less
# certain, and this share of the joint's residual, where there is more torque.
TRANSMISSION_WALD, TRANSMISSION_SHARE = 100.0, 0.05
# An elasticity takes away torque that noise of the encoders seems to add: this multiple of that is more.
OF_ENCODERS = 2.0
# Friction that bends is absorbed as well, but every joint's bends a little: so many times a healthy one's.
BENT_ENOUGH = 2.0
# First moments take up most of an eccentric encoder.
TOLD_BY_SIZE = (*SWALLOWED_FRICTION, *TRANSMISSIONS, BENDING, DELAY, ECCENTRICITY)
SMALLEST_GAIN, BEYOND = 10.0, 3.0
# What acts near rest, where samples do not count, shows little of itself: this share of the torque is
# enough where it is most of what is left, and its size is certain. So does friction of a load that hardly
# changes, and an offset, which first moments take up.
NEAR_REST, LITTLE_TORQUE, MOST_LEFT = "stribeck_friction", 0.002, 0.4
OF_ENCODER = (OFFSET, ECCENTRICITY)


def is_material(robot: Robot, stage: Stage, weighed: Weighed, is_best: bool = False) -> bool:
    """Whether a candidate explains enough to be accepted.

    robot: that sizes are relative to. is_best: whether hardly any other gains as much.
    """
    gain, family = weighed.gain, weighed.candidate.family
    if family.effect == ELASTIC and _is_of_encoders(stage, gain):
        return False
    if is_large(robot, stage, weighed) or _is_seen_beyond_rest(robot, stage, weighed):
        return True
    # What it explains at one joint may cost more at the others.
    if weighed.score <= 0:
        return False
    several = stage.prepared.joints > 1
    if family.joint is None and several and gained_elsewhere(stage, gain) < SMALLEST_ELSEWHERE:
        return False
    least = SPRING_SHIFT if family.effect == SPRING else SMALLEST_SHIFT + by_chance(gain.candidate)
    shifts = gained_by_shift(stage, gain) > least and gained(stage, gain) > SMALLEST_SUM
    if gain.overlap > HIDDEN_OVERLAP and shifts and not _is_of_sensors(robot, stage, gain):
        return True
    enough = (stage.shares(gain) > SMALLEST_SHARE) & (
        stage.removed(gain) > SMALLEST_TORQUE * stage.ground.torque_rms
    )
    # What acts on one joint's torque must show there, whatever it does to the others' parameters; what the
    # joint's own parameters absorb shows where the joints below carry the same links.
    if is_best and family.swallowed and gain.overlap > HIDDEN_OVERLAP:
        return bool(np.any(enough))
    return bool(np.any(enough[list(gain.candidate.member.rows)]))


def is_large(robot: Robot, stage: Stage, weighed: Weighed) -> bool:
    """Whether it is of a kind judged by size, and certainly larger than on a healthy robot."""
    family, gain = weighed.candidate.family, weighed.gain
    if gain.candidate.is_common_delay:
        # All torque acts late, whatever it is called.
        if stage.timing < -LATE:
            return True
        # What a delay and the timing of the log make of each other is a derivative, not a delay.
        if gained_by_shift(stage, gain) < 0:
            return False
    if family.effect not in TOLD_BY_SIZE or weighed.score < SMALLEST_GAIN:
        return False
    own = list(gain.candidate.member.rows)
    much, share = stage.torque_shares(gain)[own], stage.shares(gain)[own]
    seen, little = much > SMALLEST_TORQUE, (much > LITTLE_TORQUE) & (share > SMALLEST_SHARE)
    if family.effect in TRANSMISSIONS:
        seen &= share > TRANSMISSION_SHARE
        if gain.wald < TRANSMISSION_WALD:
            return False
    if family.effect in (*SWALLOWED_FRICTION, *TRANSMISSIONS, ECCENTRICITY):
        seen |= little
    if np.any(seen) and is_certainly_beyond(robot, stage, gain):
        return True
    is_bent = family.effect == BENDING and bool(np.any(little))
    return is_bent and is_certainly_beyond(robot, stage, gain, BENT_ENOUGH)


def _is_seen_beyond_rest(robot: Robot, stage: Stage, weighed: Weighed) -> bool:
    """Whether it acts near rest and is most of what is left away from it, however little that is."""
    family, gain = weighed.candidate.family, weighed.gain
    if family.effect != NEAR_REST or weighed.score < SMALLEST_GAIN:
        return False
    little = stage.removed(gain)[family.joint] > LITTLE_TORQUE * stage.ground.torque_rms[family.joint]
    most = stage.shares(gain)[family.joint] > MOST_LEFT
    return bool(little and most) and is_certainly_beyond(robot, stage, gain)


def _is_of_encoders(stage: Stage, gain: Gain) -> bool:
    """Whether noise of the encoders may seem as much torque as it takes off each joint that it loads."""
    own = list(gain.candidate.member.rows)
    return bool(np.all(stage.removed(gain)[own] < OF_ENCODERS * stage.prepared.encoder_torque[own]))


def _is_of_sensors(robot: Robot, stage: Stage, gain: Gain) -> bool:
    """Whether an offset of its joint's torque sensor would be as well."""
    family = gain.candidate.family
    if family.effect != OF_SENSORS or float(stage.shares(gain)[family.joint]) > OF_SENSORS_SHARE:
        return False
    return not _is_beyond(robot, stage, gain.candidate, gain.coefficients / OF_SENSORS_SIZE)


def is_certainly_beyond(robot: Robot, stage: Stage, gain: Gain, times: float = 1.0) -> bool:
    """Whether it is known to a fifth, and three deviations less are still so many times a healthy robot's."""
    if gain.wald < SMALLEST_WALD:
        return False
    least = (1 - BEYOND / np.sqrt(gain.wald)) * gain.coefficients / times
    return _is_beyond(robot, stage, gain.candidate, least)


def _is_beyond(robot: Robot, stage: Stage, candidate: Candidate, coefficients: Array) -> bool:
    """Whether it is larger than a healthy robot's, by the torques of the stage."""
    return is_beyond_healthy(robot, stage.ground.torque_rms, candidate, coefficients)
