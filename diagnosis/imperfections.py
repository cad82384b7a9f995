"""Whether what was taken in is one joint's, or how all joints of this robot are imperfect."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from testbench.robot import Robot

from .accepted import Accepted
from .candidates import Candidate
from .healthy import BRISTLES, SPRINGS, times_healthy
from .likelihood import Weighed
from .materiality import BEYOND, SMALLEST_SHARE, SMALLEST_WALD
from .weighing import Stage

Array = NDArray[np.float64]

# Friction that bends, teeth: of what so many other joints have some, this share of it each, or of
# friction that differs by direction or with the load, is how this robot's joints are, not what one of them
# has. And a spring that presses on its joint no more than the others' imperfections do may be made of those.
# Unless what the parameters swallow of it spares them a shift of this log-likelihood.
UNEVEN = ("stribeck_friction", "nonlinear_viscous_friction", "transmission_ripple")
FRICTION = (*UNEVEN, BRISTLES, "asymmetric_friction", "load_dependent_friction")
SUCH_JOINTS = 2
ALIKE = ((UNEVEN, FRICTION, 0.38, np.inf), (SPRINGS, (*FRICTION, *SPRINGS), 0.8, 7.5))
# But Stribeck friction is one joint's where it is certainly so many times a healthy one's, and twice as many
# as the other joints' friction: of a joint that carries little torque, a little of it is more.
ONE_JOINTS, FAR_BEYOND, TWICE = "stribeck_friction", 2.0, 2.0
# Near rest no joint's friction is quite as modelled, and bristles fit a little of that at many joints: they
# have a name where they are this share of their joint's torque; or where others are not surely as large and
# Wald's statistic tells them, so many times that of any other joint, or they are this share of the rest.
BRISTLES_WALD, BRISTLES_ALONE, BRISTLES_SHARE, BRISTLES_TORQUE = 80.0, 10.0, 0.85, 0.015


def of_one_joint(
    robot: Robot, accepted: Sequence[Accepted], open_: Sequence[Weighed], last: Stage
) -> list[Accepted]:
    """What was taken in, without the names of what is hardly larger than several other joints' imperfections.

    Largest first: what keeps its name is none of those. robot: that sizes are relative to. open_: what is not
    taken in. last: with all that is.
    """
    found, faults = list(accepted), set[int]()
    for place in sorted(range(len(found)), key=lambda k: -found[k].worth):
        item, joint = found[place], found[place].candidate.family.joint
        if not item.named:
            continue
        rest = [each for k, each in enumerate(found) if k != place and k not in faults]
        others = _seen_elsewhere(robot, joint, open_, last)
        for kind, imperfections, share, shift in ALIKE:
            if joint is not None and item.candidate.family.effect in kind and item.shift < shift:
                levels = np.sort(np.delete(_levels(imperfections, rest, open_, last), joint))
                as_large = len(levels) >= SUCH_JOINTS and levels[-SUCH_JOINTS] >= share * np.sqrt(item.worth)
                if as_large and not _is_of_one(robot, place, others, last):
                    found[place] = replace(item, named=False, is_everywhere=True)
        is_bristles = item.candidate.family.effect == BRISTLES
        if is_bristles and not _are_bristles_of_one(robot, place, item, others, last):
            found[place] = replace(item, named=False, is_everywhere=True)
        if found[place].named:
            faults.add(place)
    return found


@dataclass(frozen=True)
class _Seen:
    """An effect, taken in or not: how many times what a healthy joint has, and Wald's statistic."""

    effect: str
    times: float
    wald: float


def _seen_elsewhere(robot: Robot, joint: int | None, open_: Sequence[Weighed], last: Stage) -> list[_Seen]:
    """What is seen of effects at the other joints."""
    parts = zip(last.hypothesis.accepted, last.hypothesis.parts, strict=True)
    seen = [(each, last.fitted.values[part], last.fitted.wald(part)) for each, part in parts]
    seen += [(w.candidate, w.gain.coefficients, w.gain.wald) for w in open_]
    return [
        _Seen(each.family.effect, _times(robot, last, each, values), wald)
        for each, values, wald in seen
        if each.family.joint not in (None, joint)
    ]


def _times(robot: Robot, last: Stage, candidate: Candidate, values: Array) -> float:
    return times_healthy(robot, last.ground.torque_rms, candidate, values)


def _is_of_one(robot: Robot, place: int, others: Sequence[_Seen], last: Stage) -> bool:
    """Whether the last hypothesis's effect here is Stribeck friction far beyond the other joints'."""
    own, part = last.hypothesis.accepted[place], last.hypothesis.parts[place]
    if own.family.effect != ONE_JOINTS:
        return False
    times, wald = _times(robot, last, own, last.fitted.values[part]), last.fitted.wald(part)
    friction = [each for each in others if each.effect in FRICTION and each.effect != BRISTLES]
    most = max((each.times for each in friction if each.wald > SMALLEST_WALD), default=0.0)
    return times * (1 - BEYOND / np.sqrt(wald)) > FAR_BEYOND and times > TWICE * most


def _are_bristles_of_one(
    robot: Robot, place: int, item: Accepted, others: Sequence[_Seen], last: Stage
) -> bool:
    """Whether the last hypothesis's bristles here are much of their joint's torque, or seen far better."""
    if np.sqrt(item.worth) > BRISTLES_TORQUE:
        return True
    own, part = last.hypothesis.accepted[place], last.hypothesis.parts[place]
    times, wald = _times(robot, last, own, last.fitted.values[part]), last.fitted.wald(part)
    bristles = [each for each in others if each.effect == BRISTLES]
    if sum(each.wald > BRISTLES_WALD and each.times >= times for each in bristles) >= SUCH_JOINTS:
        return False
    most = max((each.wald for each in bristles), default=0.0)
    return item.share > BRISTLES_SHARE or wald > max(BRISTLES_WALD, BRISTLES_ALONE * most)


def _levels(
    effects: Sequence[str], accepted: Sequence[Accepted], open_: Sequence[Weighed], last: Stage
) -> Array:
    """The largest of these effects at each joint, as a share of its RMS torque, (n,)."""
    levels = np.zeros(last.prepared.joints)
    for each in accepted:
        if each.candidate.family.effect in effects:
            joint = each.candidate.family.joint
            levels[joint] = max(levels[joint], np.sqrt(each.worth))
    for other in open_:
        joint, gain = other.candidate.family.joint, other.gain
        if other.candidate.family.effect not in effects or other.score <= 0:
            continue
        # Of many shapes, one fits a little of any noise.
        if gain.wald > SMALLEST_WALD and last.shares(gain)[joint] > SMALLEST_SHARE:
            levels[joint] = max(levels[joint], last.torque_shares(gain)[joint])
    return levels
