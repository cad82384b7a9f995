"""Held-out check of reported effects: each must also close the gap on whole runs that the fit left out."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..fit.linearisation import TRANSMISSIONS
from ..model.candidates import SATURATION
from ..model.effect_sizes import RIPPLE
from ..plausibility.accepted import SLOWEST_RIPPLE, Accepted
from ..residual.unexplained import NOTHING, UNTOLD, Unclaimed
from .findings import Gap

Array = NDArray[np.float64]

# An effect that takes less than this share of its joint's gap off runs left out, where that gap and what all
# runs together fit are so many times the noise, is not the robot's. Nor are effects that take less than half
# of that off the gap of all joints, where it is farther from noise, and all runs together leave so many times
# the noise: what two unlike runs predict of each other may be far off, whatever acts.
EXPLAINED, FAR_FROM_NOISE = 0.2, 3.0
EXPLAINED_OF_ALL, FARTHER_FROM_NOISE, FIT_TO_NOISE = 0.1, 4.0, 1.5
# Nor are those that leave so many times the noise of it, where they close less than this share of what was
# beyond the noise, on runs left out and on all runs together: effects reported so are mostly wrong. A push
# leaves much where it acted otherwise, a gearbox that stiffens otherwise too.
LEFT_FAR_FROM_NOISE, MOSTLY_CLOSED = 4.5, 0.79
# So may teeth and drives' limits that make so much of a joint's squared residual: the former have more
# harmonics than two, and the latter fall with speed.
ALL_BUT_ALL = 0.9
# Of a joint whose reported effect fails the check, a residual of less than this share of its torque is
# nothing to explain.
LEAST_UNMET = 0.01
# A push alone takes this share of the gap, or of some joint's that is so many times the noise: real ones
# three quarters, or all of a joint's.
OF_A_PUSH, OF_ITS_JOINT, BEYOND_NOISE = 0.55, 0.8, 1.3
# Unreported effects that take this share of a joint's torque, and of its gap, off runs left out are too large
# for a healthy robot's imperfections.
CLOSED_TORQUE, CLOSED_SHARE = 0.08, 0.5


def names_that_hold(
    accepted: Sequence[Accepted], gap: Gap, fitted: Array, torque: Array
) -> tuple[tuple[Accepted, ...], tuple[Unclaimed, ...]]:
    """Effects still reported after the held-out check, and the joints where one that failed it is withdrawn.

    One fails that leaves too much of its joint's gap, or of all joints'.

    gap: on whole runs left out. fitted, torque: (n,) N·m RMS, what all runs fitted together leave, and of the
    joints. An effect seen in only one run may leave the gap of that run as it was, but not what all runs fit.
    An effect that parameters absorb never seemed to explain it. A push of such a joint is part of its
    residual.
    """
    closed, reducible = gap.parameters - gap.effects, gap.parameters - gap.noise_floor
    is_far = np.minimum(gap.parameters, fitted) > FAR_FROM_NOISE * gap.noise_floor
    leaves_too_much = is_far & (closed < EXPLAINED * reducible)
    is_misfit = fitted.sum() >= FIT_TO_NOISE * gap.noise_floor.sum()
    if is_misfit and gap.parameters.sum() > FARTHER_FROM_NOISE * gap.noise_floor.sum():
        leaves_too_much |= bool(closed.sum() < EXPLAINED_OF_ALL * reducible.sum())
    pushed = any(item.named and item.candidate.is_event for item in accepted)
    stays_far = _stays_far(gap, fitted, torque) & (not pushed)
    left = np.minimum(gap.effects / np.maximum(gap.parameters, 1e-300), 1.0) ** 2
    found, nearest = [], dict[int, str]()
    for item in accepted:
        joint = item.candidate.family.joint
        seems = item.named and item.share > EXPLAINED and not item.candidate.is_event
        holds = item.candidate.family.effect in TRANSMISSIONS or _is_all_but_its_rest(item)
        if seems and joint is not None and (leaves_too_much[joint] or (stays_far[joint] and not holds)):
            item = replace(item, named=False)
            nearest.setdefault(joint, item.candidate.family.effect)
        found.append(item)
    # A push there was found in what such an effect had left.
    is_rest = [item.candidate.is_event and item.candidate.family.joint in nearest for item in found]
    kept = tuple(
        replace(item, named=item.named and not rest) for item, rest in zip(found, is_rest, strict=True)
    )
    unmet = [joint for joint in sorted(nearest) if gap.effects[joint] > LEAST_UNMET * torque[joint]]
    return kept, tuple(
        Unclaimed(joint, NOTHING, float(left[joint]), nearest=nearest[joint]) for joint in unmet
    )


def _is_all_but_its_rest(item: Accepted) -> bool:
    """Whether it is a limit, or a ripple of gear teeth, that explains nearly all of its joint's residual."""
    shape, effect = item.candidate.member.shape, item.candidate.family.effect
    are_teeth = effect == RIPPLE and shape["cycles"] > SLOWEST_RIPPLE
    return item.share > ALL_BUT_ALL and (are_teeth or effect == SATURATION)


def _stays_far(gap: Gap, fitted: Array, torque: Array) -> NDArray[np.bool_]:
    """The joints (n,) whose gap stays far from noise, too little of it closed; arguments as above."""
    closed, reducible = gap.parameters - np.minimum(gap.effects, fitted), gap.parameters - gap.noise_floor
    is_far = gap.effects > np.maximum(LEFT_FAR_FROM_NOISE * gap.noise_floor, LEAST_UNMET * torque)
    is_misfit = fitted > FAR_FROM_NOISE * gap.noise_floor
    return is_far & is_misfit & (closed < MOSTLY_CLOSED * reducible)


def pushes_that_hold(
    accepted: Sequence[Accepted], gap: Gap
) -> tuple[tuple[Accepted, ...], tuple[Unclaimed, ...]]:
    """Effects with pushes no longer reported if nothing else is and they leave much of the gap; the joints.

    Nor do they close enough of any one joint's. The joints are those of the pushes withdrawn, since what acts
    in bursts there is not the surroundings. gap: on whole runs left out.
    """
    named = [item for item in accepted if item.named]
    is_far = gap.parameters > BEYOND_NOISE * gap.noise_floor
    closed = np.array([gap.closed_at(joint) or 0.0 for joint in range(len(is_far))])
    holds = gap.closed is None or gap.closed > OF_A_PUSH or np.any(closed[is_far] > OF_ITS_JOINT)
    if not named or holds or not all(item.candidate.is_event for item in named):
        return tuple(accepted), ()
    joints = {item.candidate.family.joint for item in named}
    left = np.minimum(gap.effects / np.maximum(gap.parameters, 1e-300), 1.0) ** 2
    return tuple(replace(item, named=False) for item in accepted), tuple(
        Unclaimed(joint, NOTHING, float(left[joint])) for joint in sorted(j for j in joints if j is not None)
    )


def closed_without_a_name(accepted: Sequence[Accepted], gap: Gap, torque: Array) -> tuple[Unclaimed, ...]:
    """The joints whose gap is closed by effects that are not reported, where none is: the cause stays open.

    Effects that other joints have alike are reported as that. gap, torque: as of ``names_that_hold``.
    """
    if any(item.named for item in accepted):
        return ()
    closed = np.maximum(gap.parameters**2 - gap.effects**2, 0.0)
    share = closed / np.maximum(gap.parameters**2, np.finfo(float).tiny)
    much = (closed > (CLOSED_TORQUE * torque) ** 2) & (share > CLOSED_SHARE)
    alike = {item.candidate.family.joint for item in accepted if item.is_everywhere}
    joints = [joint for joint in np.flatnonzero(much).tolist() if joint not in alike]
    return tuple(Unclaimed(joint, UNTOLD, float(share[joint])) for joint in joints)
