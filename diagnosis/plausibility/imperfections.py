"""Distinction of a fault of one joint from imperfections that several joints of the robot share."""

from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from testbench.robot import Robot

from ..fit.likelihood import Weighed
from ..fit.score import Stage
from ..model.candidates import Candidate
from ..model.effect_sizes import BENDING, BRISTLES, CABLE, OF_THE_LOAD, SPRING, SPRINGS, times_healthy
from .accepted import Accepted
from .materiality import BEYOND, SMALLEST_SHARE, SMALLEST_WALD

Array = NDArray[np.float64]

# Friction that bends, teeth: of what so many other joints have some, this share of it each, or of
# friction that differs by direction or with the load, is how this robot's joints are, not what one of them
# has. So is a cable, of which every joint has one. And a spring, or friction by load, that presses on its
# joint no more than the others' imperfections do may be made of those: a spring unless what the parameters
# absorb of it spares them a shift of this log-likelihood.
UNEVEN = ("stribeck_friction", "nonlinear_viscous_friction", "transmission_ripple")
FRICTION = (*UNEVEN, BRISTLES, "asymmetric_friction", "load_dependent_friction")
SUCH_JOINTS = 2
ALIKE: Mapping[str, tuple[tuple[str, ...], float, float]] = {
    **dict.fromkeys(UNEVEN, (FRICTION, 0.38, np.inf)),
    CABLE: ((*FRICTION, *SPRINGS), 0.35, np.inf),
    SPRING: ((*FRICTION, *SPRINGS), 0.8, 15.0),
    OF_THE_LOAD: ((*FRICTION, *SPRINGS), 0.8, np.inf),
}
# But an effect whose joint carries little other torque, or whose parameters absorb it, is one joint's where
# it is certainly so many times a healthy one's, and so many times as far beyond as these of the other joints:
# each joint's friction bends a little. What grows with the load differs from others' by its own size; what
# falls with the speed, if no more of the others' torque is imperfect than this multiple of it, or it is far
# more than that. Of a cable first moments leave little, but it pulls as it does.
SLIDING = tuple(each for each in FRICTION if each != BRISTLES)
ONE_JOINTS: Mapping[str, tuple[tuple[str, ...], tuple[tuple[float, float, float], ...]]] = {
    "stribeck_friction": (SLIDING, ((2.0, 2.0, 1.0), (4.0, 3.0, np.inf))),
    BENDING: (SLIDING, ((2.0, 3.5, np.inf),)),
    OF_THE_LOAD: (SLIDING, ((1.5, 0.0, np.inf),)),
    CABLE: (SPRINGS, ((1.5, 3.5, np.inf),)),
}
# Near rest no joint's friction is quite as modelled, and bristles fit a little of that at many joints: up to
# this share of their joint's torque they are not reported where others surely give way this share as far,
# with this share of the torque, and whatever they are where this share of the other joints does, three at
# least; nor, up to another share of the torque, unless the Wald statistic shows them, so many times that of
# any other joint, or they are this share of the residual. Where samples near rest count they are so many
# times that share.
BRISTLES_OF_ALL, BRISTLES_ALIKE, BRISTLES_LEVEL, BRISTLES_MOST = 0.025, 0.5, 0.25, 0.5
BRISTLES_HELD = 2.5
BRISTLES_WALD, BRISTLES_ALONE, BRISTLES_SHARE, BRISTLES_TORQUE = 80.0, 10.0, 0.85, 0.015


def of_one_joint(
    robot: Robot, accepted: Sequence[Accepted], open_: Sequence[Weighed], last: Stage
) -> list[Accepted]:
    """The accepted effects; those hardly larger than several other joints' imperfections are not reported.

    Largest first: one that stays reported counts as a fault, not an imperfection. robot: that sizes are
    relative to. open_: effects not accepted. last: the stage with all that are.
    """
    found, faults = list(accepted), set[int]()
    for place in sorted(range(len(found)), key=lambda k: -found[k].worth):
        item = found[place]
        if not item.named:
            continue
        is_imperfection = _is_hardly_larger(robot, place, found, faults, open_, last)
        others = [each for k, each in enumerate(found) if k != place]
        if is_imperfection or _are_bristles_of_all(robot, place, item, others, open_, last):
            found[place] = replace(item, named=False, is_everywhere=True)
        else:
            faults.add(place)
    return found


def _is_hardly_larger(
    robot: Robot,
    place: int,
    found: Sequence[Accepted],
    faults: Set[int],
    open_: Sequence[Weighed],
    last: Stage,
) -> bool:
    """Whether several other joints have as much, of their own torque, of what it may be made of.

    faults: the places of what is one joint's for certain.
    """
    item = found[place]
    rest = [each for k, each in enumerate(found) if k != place and k not in faults]
    if item.candidate.family.effect not in ALIKE:
        return False
    imperfections, share, shift = ALIKE[item.candidate.family.effect]
    if item.shift >= shift:
        return False
    if _are_as_large(robot, place, item, open_, last):
        return True
    others = _of_others(item, imperfections, rest, open_, last)
    return others >= share and not _is_of_one(robot, place, others, faults, open_, last)


def _are_as_large(robot: Robot, place: int, item: Accepted, open_: Sequence[Weighed], last: Stage) -> bool:
    """Whether several joints have as many times what a healthy one has, and this one no more than that.

    Where its joint carries little torque beside, it stands out of that all the same.
    """
    own, others = _seen(robot, place, [item.candidate.family.effect], open_, last)
    as_large = {each.joint for each in others if each.wald > SMALLEST_WALD and each.times >= own.times}
    return own.times <= 1 and len(as_large) >= SUCH_JOINTS


def _of_others(
    item: Accepted,
    effects: Sequence[str],
    rest: Sequence[Accepted],
    open_: Sequence[Weighed],
    last: Stage,
) -> float:
    """Size of these effects at several other joints, relative to the item's, each by its joint's torque."""
    joint = item.candidate.family.joint
    assert joint is not None
    levels = np.sort(np.delete(_levels(effects, rest, open_, last), joint))
    if len(levels) < SUCH_JOINTS:
        return 0.0
    return float(levels[-SUCH_JOINTS] / np.sqrt(max(item.worth, 1e-300)))


@dataclass(frozen=True)
class _Seen:
    """An effect, accepted or not: its joint, its multiple of a healthy one's size, its Wald statistic."""

    joint: int
    times: float
    wald: float


def _seen(
    robot: Robot,
    place: int,
    effects: Sequence[str],
    open_: Sequence[Weighed],
    last: Stage,
    faults: Set[int] = frozenset(),
) -> tuple[_Seen, list[_Seen]]:
    """The last hypothesis's effect at this place, and what is seen of some effects at the other joints.

    faults: places that do not count.
    """

    def seen(candidate: Candidate, values: Array, wald: float) -> _Seen:
        assert candidate.family.joint is not None
        times = times_healthy(robot, last.ground.torque_rms, candidate, values)
        return _Seen(candidate.family.joint, times, wald)

    parts = zip(last.hypothesis.accepted, last.hypothesis.parts, strict=True)
    every = [(each, last.fitted.values[part], last.fitted.wald(part)) for each, part in parts]
    own = every[place]
    every = [each for k, each in enumerate(every) if k not in faults]
    every += [(w.candidate, w.gain.coefficients, w.gain.wald) for w in open_]
    elsewhere = [each for each in every if each[0].family.joint not in (None, own[0].family.joint)]
    return seen(*own), [seen(*each) for each in elsewhere if each[0].family.effect in effects]


def _is_of_one(
    robot: Robot, place: int, theirs: float, faults: Set[int], open_: Sequence[Weighed], last: Stage
) -> bool:
    """Whether the last hypothesis's effect here is far beyond what the other joints have of its kind.

    theirs: of ``_of_others``. faults: places that do not count.
    """
    effect = last.hypothesis.accepted[place].family.effect
    if effect not in ONE_JOINTS:
        return False
    its_kind, levels = ONE_JOINTS[effect]
    own, others = _seen(robot, place, its_kind, open_, last, faults)
    most = max((each.times for each in others if each.wald > SMALLEST_WALD), default=0.0)
    certainly = own.times * (1 - BEYOND / np.sqrt(own.wald))
    return any(
        theirs <= of_others and certainly > far_beyond and own.times > as_others * most
        for far_beyond, as_others, of_others in levels
    )


def _are_bristles_of_all(
    robot: Robot,
    place: int,
    item: Accepted,
    rest: Sequence[Accepted],
    open_: Sequence[Weighed],
    last: Stage,
) -> bool:
    """Whether this effect is bristles that are no fault of their joint.

    Most joints have such; or two have, and they are little of its torque; or less, and seen no better than
    another's.
    """
    torque = float(np.sqrt(item.worth))
    if item.candidate.family.effect != BRISTLES:
        return False
    own, others = _seen(robot, place, [BRISTLES], open_, last)
    # The softest bristles are no fault where they hardly press on their joint.
    much = _levels([BRISTLES], rest, open_, last) >= BRISTLES_LEVEL * torque
    alike = [each for each in others if each.times >= BRISTLES_ALIKE * own.times and much[each.joint]]
    surely = sum(each.wald > BRISTLES_WALD for each in alike)
    many = max(BRISTLES_MOST * (last.prepared.joints - 1), SUCH_JOINTS + 1)
    little = BRISTLES_OF_ALL * (BRISTLES_HELD if own.joint in last.prepared.held else 1.0)
    if surely >= (SUCH_JOINTS if torque <= little else many):
        return True
    if torque > BRISTLES_TORQUE:
        return False
    most = max((each.wald for each in others), default=0.0)
    return item.share <= BRISTLES_SHARE and own.wald <= max(BRISTLES_WALD, BRISTLES_ALONE * most)


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
