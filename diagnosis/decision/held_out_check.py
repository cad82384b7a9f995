"""Held-out check of effects without a name: the share of the gap that they close."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..plausibility.accepted import Accepted
from ..residual.shares import UNCERTAIN, Unclaimed
from .findings import Gap

Array = NDArray[np.float64]

# Unreported effects that take this share of a joint's torque, and of its gap, off runs left out are too large
# for a healthy robot's imperfections.
CLOSED_TORQUE, CLOSED_SHARE = 0.08, 0.5


def closed_without_a_name(accepted: Sequence[Accepted], gap: Gap, torque: Array) -> tuple[Unclaimed, ...]:
    """The joints whose gap is closed by effects that are not reported, where none is: the cause stays open.

    Effects that other joints have alike are reported as that. gap: on whole runs left out. torque: (n,) N·m
    of the joints.
    """
    if any(item.named for item in accepted):
        return ()
    closed = np.maximum(gap.parameters**2 - gap.effects**2, 0.0)
    share = closed / np.maximum(gap.parameters**2, np.finfo(float).tiny)
    much = (closed > (CLOSED_TORQUE * torque) ** 2) & (share > CLOSED_SHARE)
    alike = {item.candidate.family.joint for item in accepted if item.is_everywhere}
    joints = [joint for joint in np.flatnonzero(much).tolist() if joint not in alike]
    return tuple(Unclaimed(joint, UNCERTAIN, float(share[joint])) for joint in joints)
