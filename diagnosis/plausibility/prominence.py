"""Rules on when an effect stands out enough to report it: against other joints, and its joint's first effect.

A law that is not quite the robot's leaves a residual at the same joint, and other effects fit a good part of
it: a second effect there must explain more than that.
"""

from collections.abc import Sequence

import numpy as np

from testbench.effects.signature import Family
from testbench.robot import Robot

from ..fit.likelihood import Weighed, gained_by_shift
from ..fit.linearisation import TRANSMISSIONS
from ..fit.score import Gain, Stage
from ..model.candidates import Candidate
from ..model.effect_sizes import BRISTLES, CABLE, ECCENTRICITY, GAIN, RIPPLE, SPRING, SPRINGS
from .materiality import (
    HIDDEN_OVERLAP,
    SMALLEST_SHIFT,
    is_certainly_beyond,
    is_large,
)

# Share of a joint's squared residual after re-identification that a reported effect explains: what it leaves
# because its law is not quite the robot's is less.
NAMED_SHARE = 0.05
# And the share of what is left there when it is accepted, or the log-likelihood as a multiple of what any
# other joint's effect gains: imperfections that are no smaller would not let it be distinguished from them.
STANDING_OUT, PROMINENT = 0.2, 3.0
# But none of them looks like these; bristles are held against those of the other joints.
UNLIKE = ("thermal_friction_drift", ECCENTRICITY, BRISTLES)
# Wald's statistic of an imperfection: what has less predicts well by chance.
SEEN = 9.0
# Every arm has cables: one that is no more than this share of what is left is certainly so many times a
# healthy one, or not reported; nor is one of less than this share of the joint's RMS torque, unless what the
# parameters absorb of it spares them a shift of this log-likelihood.
CABLE_LEFT, CABLE_BEYOND, CABLE_TORQUE, CABLE_SHIFT = 0.6, 1.2, 0.015, 5.0
# A spring that the parameters absorb must bring them nearer to the model's, but for this log-likelihood:
# else the two only make up for each other.
FARTHER = -2.0
# At a joint that has an effect already: this share of the squared residual after re-identification ...
SECOND_SHARE = 0.2
# ... or this share of what is left there, and of its RMS torque. A law of position at a coupling's other
# joint, and a gain error beside friction of these laws, are certainly so many times a healthy one's: the
# residuals of those laws are no part of all torque.
SECOND_LEFT, SECOND_TORQUE, SECOND_BEYOND = 0.5, 0.02, 1.5
BESIDE_GAIN = (
    "stribeck_friction",
    "asymmetric_friction",
    "nonlinear_viscous_friction",
    "thermal_friction_drift",
    BRISTLES,
    RIPPLE,
)


def is_main(
    robot: Robot,
    first: Stage,
    stage: Stage,
    best: Weighed,
    firsts: Sequence[Candidate],
    rest: Sequence[Weighed],
) -> bool:
    """Whether an effect explains a fair part of some joint's residual after re-identification.

    robot: that sizes are relative to. firsts: effects that are reported already. A law that is not quite the
    robot's leaves a residual at the same joint, and other effects fit a good part of it: a second effect
    there must explain more. rest: gains of the other candidates of the catalogue.
    """
    gain, family = best.gain, best.candidate.family
    shares = first.shares(gain)
    if gain.candidate.is_event:
        return True
    if family.effect == SPRING and gain.overlap > HIDDEN_OVERLAP and gained_by_shift(stage, gain) < FARTHER:
        return False
    seen = (w for w in rest if w.candidate.family.joint != family.joint and w.gain.wald > SEEN)
    elsewhere = max((w.score for w in seen), default=0.0)
    if family.effect == CABLE and _is_any_cable(robot, stage, gain):
        return False
    named, coupled = {each.family.joint for each in firsts}, {each.family.into for each in firsts}
    if family.joint in coupled - named and family.effect == ECCENTRICITY:
        # No law of speeds leaves what an encoder's error of an angle is.
        return is_certainly_beyond(robot, stage, gain, SECOND_BEYOND)
    if family.joint is not None and family.joint in named | coupled:
        is_second = _is_no_rest(robot, stage, gain, firsts)
        if not _is_of_one_transmission(family, firsts):
            is_second |= bool(shares[family.joint] > SECOND_SHARE)
        # At a coupling's other joint it must be as much as anywhere, too.
        if family.joint in named or not is_second:
            return is_second
        # But no law of speeds leaves one of positions.
        if family.effect in (*SPRINGS, RIPPLE) and is_certainly_beyond(robot, stage, gain, SECOND_BEYOND):
            return True
    if family.swallowed or gained_by_shift(stage, gain) > SMALLEST_SHIFT:
        return True
    if family.effect in UNLIKE or is_large(robot, stage, best):
        return True
    own = stage.shares(gain)[list(gain.candidate.member.rows)].max()
    if family.joint is not None and own < STANDING_OUT and best.score < PROMINENT * elsewhere:
        return False
    return bool(np.any(shares > NAMED_SHARE))


def _is_any_cable(robot: Robot, stage: Stage, gain: Gain) -> bool:
    """Whether it is little, or neither most of what is left at its joint nor certainly beyond every arm's."""
    joint = gain.candidate.family.joint
    if stage.torque_shares(gain)[joint] < CABLE_TORQUE and gained_by_shift(stage, gain) < CABLE_SHIFT:
        return True
    left = float(stage.shares(gain)[joint])
    return left < CABLE_LEFT and not is_certainly_beyond(robot, stage, gain, CABLE_BEYOND)


def _is_of_one_transmission(family: Family, firsts: Sequence[Candidate]) -> bool:
    """Whether both it and one of these are a play or an elasticity of its joint.

    Each imitates most of the other, and no tooth is as modelled: what one leaves the other seems to explain.
    """
    own = [each.family.effect for each in firsts if each.family.joint == family.joint]
    return family.effect in TRANSMISSIONS and not set(TRANSMISSIONS).isdisjoint(own)


def _is_no_rest(robot: Robot, stage: Stage, gain: Gain, firsts: Sequence[Candidate]) -> bool:
    """Whether a second effect of a joint is too large for the residual of the first one's law."""
    family, rows = gain.candidate.family, gain.candidate.member.rows
    assert family.joint is not None
    beside = {each.family.effect for each in firsts if family.joint in (each.family.joint, each.family.into)}
    is_apart = family.effect == GAIN and beside <= set(BESIDE_GAIN)
    if is_apart and is_certainly_beyond(robot, stage, gain, SECOND_BEYOND):
        return True
    # What it does to joints that the first ones do nothing to is no rest either.
    reached = {row for each in firsts for row in each.member.rows}
    own = [family.joint, *(row for row in rows if row not in reached)]
    most = own[int(np.argmax(stage.shares(gain)[own]))]
    torque, left = float(stage.torque_shares(gain)[most]), float(stage.shares(gain)[most])
    return torque > SECOND_TORQUE and left > SECOND_LEFT
