"""Held-out check of pushes, and of effects without a name: the share of the gap that they close."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..plausibility.accepted import Accepted
from ..residual.unexplained import NOTHING, UNTOLD, Unclaimed
from .findings import Gap

Array = NDArray[np.float64]

# A push alone takes this share of the gap, or of some joint's that is so many times the noise: real ones
# three quarters, or all of a joint's.
OF_A_PUSH, OF_ITS_JOINT, BEYOND_NOISE = 0.55, 0.8, 1.3
# Unreported effects that take this share of a joint's torque, and of its gap, off runs left out are too large
# for a healthy robot's imperfections.
CLOSED_TORQUE, CLOSED_SHARE = 0.08, 0.5


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
