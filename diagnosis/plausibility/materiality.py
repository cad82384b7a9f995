"""Material effects, worth accepting: statistical significance would be a false alarm on any healthy robot.

An effect matters when it explains a fair part of some joint's error on runs left out and of its torque; or,
where re-identified parameters absorb it, when it spares them a shift that CAD does not explain; or when it is
certainly larger than on a healthy robot. Whether it is a fault is decided later, by its probability.
"""

import numpy as np
from numpy.typing import NDArray

from testbench.robot import Robot

from ..fit.likelihood import Weighed, by_chance, gained, gained_by_shift, gained_elsewhere
from ..fit.score import Gain, Stage
from ..model.effect_sizes import SMALLEST_TORQUE, is_beyond_healthy
from ..model.hypothesis import LATE

Array = NDArray[np.float64]

# Share of a joint's held-out squared residual that an effect must explain, beside SMALLEST_TORQUE.
SMALLEST_SHARE = 0.10
# Log-likelihood that an effect must add: by the shift of parameters that it makes unnecessary, where these
# absorb this share of its columns; at other joints than the best, if it acts on the whole robot; and where
# it is larger than on a healthy robot.
SMALLEST_GAIN, ABSORBED = 7.5, 0.9
# Wald statistic of a size known to a fifth, and deviations by which one is beyond a healthy robot's.
SMALLEST_WALD, BEYOND = 25.0, 3.0
# What takes away torque that noise of the encoders seems to add takes more than this multiple of that.
OF_ENCODERS = 2.0


def is_material(robot: Robot, stage: Stage, weighed: Weighed) -> bool:
    """Whether a candidate explains enough to be accepted. robot: that sizes are relative to."""
    gain, family = weighed.gain, weighed.candidate.family
    if gain.candidate.description.like_encoder_noise and _is_of_encoders(stage, gain):
        return False
    if gain.candidate.is_common_delay and stage.timing < -LATE:
        # All torque acts late, whatever it is called.
        return True
    # What it explains at one joint may cost more at the others.
    if weighed.score <= 0:
        return False
    several = stage.prepared.joints > 1
    if family.joint is None and several and gained_elsewhere(stage, gain) < SMALLEST_GAIN:
        return False
    return _is_absorbed(stage, gain) or _is_seen(robot, stage, weighed)


def _is_absorbed(stage: Stage, gain: Gain) -> bool:
    """Whether parameters absorb it, and it spares them a shift that neither CAD nor chance explains."""
    shifts = gained_by_shift(stage, gain) > SMALLEST_GAIN + by_chance(gain.candidate)
    return bool(gain.overlap > ABSORBED and shifts and gained(stage, gain) > SMALLEST_GAIN)


def _is_seen(robot: Robot, stage: Stage, weighed: Weighed) -> bool:
    """Whether it explains enough of the torque where it acts, or is certainly larger than a healthy robot's.

    What the joint's own parameters absorb shows where the joints below carry the same links.
    """
    gain, family = weighed.gain, weighed.candidate.family
    is_absorbed = family.swallowed and gain.overlap > ABSORBED
    own = list(range(stage.prepared.joints) if is_absorbed else weighed.candidate.member.rows)
    seen = (stage.removed(gain) > SMALLEST_TORQUE * stage.base.torque_rms)[own]
    if np.any(seen & (stage.shares(gain)[own] > SMALLEST_SHARE)):
        return True
    return bool(np.any(seen) and weighed.score > SMALLEST_GAIN and _is_certainly_beyond(robot, stage, gain))


def _is_of_encoders(stage: Stage, gain: Gain) -> bool:
    """Whether noise of the encoders may seem as much torque as it takes off each joint that it loads."""
    own = list(gain.candidate.member.rows)
    return bool(np.all(stage.removed(gain)[own] < OF_ENCODERS * stage.prepared.encoder_torque[own]))


def _is_certainly_beyond(robot: Robot, stage: Stage, gain: Gain) -> bool:
    """Whether it is known to a fifth, and three deviations less are still more than a healthy robot has."""
    if gain.wald < SMALLEST_WALD:
        return False
    least = (1 - BEYOND / np.sqrt(gain.wald)) * gain.coefficients
    return is_beyond_healthy(robot, stage.base.torque_rms, gain.candidate, least)
