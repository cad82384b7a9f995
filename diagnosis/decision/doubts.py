"""Why an effect that was fitted is not reported as a cause: held-out runs, bounds and deviations say no."""

from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from testbench.effects import effect

from ..fit.shape_search import CLOSE
from ..plausibility.accepted import Accepted
from .findings import NamedEffect

# Deviations within which a size may be none: 95 %.
MAY_BE_NONE = 2.0
NOT_PREDICTED = "fitted, but runs that were left out are predicted no better with it"
AT_ITS_BOUND = "fitted, but at the bound of what it may be: these runs do not determine its size"
UNCERTAIN = "fitted, but its size is within two of its own standard deviations"
TOO_SHORT = "fitted, but the runs hold too few seconds of motion of every joint that it loads"
SECOND = "fitted, beside a larger effect of its joint: a law that is nearly the joint's leaves as much"
ONE_SINE = "fitted, but each joint follows one sine: laws of position and inertia are one along it"
IN_ANOTHER_UNIT = "fitted, but a torque that it acts on may be in another unit, by the checks of the logs"


def with_support(accepted: Sequence[Accepted], supported: NDArray[np.bool_]) -> tuple[Accepted, ...]:
    """The fitted effects, those not reported at none of whose joints held-out runs are predicted better.

    supported: (n,) of the joints where they are. Exempt are effects that re-identification absorbs, which
    the parameters' shift shows, and pushes, which predict no other run.
    """
    return tuple(
        replace(a, named=False, doubt=NOT_PREDICTED) if _is_unsupported(a, supported) else a for a in accepted
    )


def _is_unsupported(item: Accepted, supported: NDArray[np.bool_]) -> bool:
    family = item.candidate.family
    if not item.named or family.swallowed or item.candidate.is_event or not item.candidate.shows:
        return False
    return not supported[_joints_of(item)].any()


def _joints_of(item: Accepted) -> list[int]:
    """The joints that an effect acts on; of one of the whole robot, those that it loads."""
    family = item.candidate.family
    if family.joint is None:
        return list(item.candidate.member.rows)
    return [family.joint] if family.into is None else [family.joint, family.into]


def without_seconds(accepted: Sequence[Accepted]) -> tuple[Accepted, ...]:
    """The fitted effects, of those at one joint only the one reported that explains most.

    No law is quite the robot's, and what it leaves looks like another one of its joint. Pushes and limits are
    recognised by when they act.
    """
    largest: dict[int | None, float] = {}
    for item in filter(_is_law, accepted):
        joint = item.candidate.family.joint
        largest[joint] = max(largest.get(joint, 0.0), item.worth)
    return tuple(
        replace(item, named=False, doubt=SECOND)
        if _is_law(item) and item.worth < largest[item.candidate.family.joint]
        else item
        for item in accepted
    )


def _is_law(item: Accepted) -> bool:
    """Whether it is reported and acts on one joint whenever that moves."""
    candidate = item.candidate
    return item.named and candidate.family.joint is not None and not candidate.description.at_times


def is_too_short(item: Accepted, has_enough_samples: NDArray[np.bool_]) -> bool:
    """Whether an effect of the whole robot loads only joints of too few samples. has_enough_samples: (n,)."""
    candidate = item.candidate
    return candidate.family.joint is None and not has_enough_samples[list(candidate.member.rows)].any()


def acts_on(item: Accepted, joints: Collection[int]) -> bool:
    """Whether an effect acts on one of these joints; one of the whole robot, by any torque that it loads."""
    return any(each in joints for each in _joints_of(item))


def doubt(named: NamedEffect) -> str:
    """Why an effect's size is not known well enough to report it as a cause; empty where it is."""
    description = effect(named.effect).DESCRIPTION
    known = {parameter.name: parameter for parameter in description.parameters}
    own = [
        (known[each], named.parameters[each]) for each in description.size_names if each in named.parameters
    ]
    numbers = [
        (parameter, float(quantity.value), float(quantity.std))
        for parameter, quantity in own
        if not isinstance(quantity.value, tuple) and not isinstance(quantity.std, tuple)
    ]
    if not numbers:
        return ""
    also = [named.parameters[name] for name in description.known_by if name in named.parameters]
    is_known = any(np.any(np.abs(each.value) >= MAY_BE_NONE * np.asarray(each.std)) for each in also)
    if not is_known and all(abs(value) < MAY_BE_NONE * deviation for _, value, deviation in numbers):
        return UNCERTAIN
    # A search for a shape ends this close to a bound.
    reached = (
        np.isfinite(bound) and bound != 0 and abs(value - bound) <= CLOSE * abs(bound)
        for parameter, value, _ in numbers
        for bound in (parameter.lower, parameter.upper)
    )
    return AT_ITS_BOUND if any(reached) else ""
