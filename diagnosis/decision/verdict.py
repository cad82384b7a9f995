"""The verdict of a diagnosis: an effect, other parameters, something unknown, or no gap."""

import numpy as np
from numpy.typing import NDArray

from ..data.run import Prepared
from ..fit.normal_equations import rms
from ..model.effect_sizes import SMALLEST_TORQUE
from ..residual.shares import NOTHING
from .attribution import Attribution
from .findings import LITTLE_CLOSED, Gap

Array = NDArray[np.float64]

# Re-identification matters when it takes this share off some joint's error on runs left out, and that of the
# model as given is worth explaining.
PARAMETERS_SHARE = 0.12


def verdict_of(found: Attribution, gap: Gap) -> str:
    """One of VERDICTS, by the effects that are reported and what is unknown."""
    named = any(item.named for item in found.accepted)
    if found.unknown and not (named and _closes_more(found)):
        return "unknown"
    if named:
        return "effect"
    torque = joint_torque(found.prepared)
    better = (gap.nominal > gap.parameters * (1 + PARAMETERS_SHARE)) & (
        gap.nominal > SMALLEST_TORQUE * torque
    )
    return "parameters" if np.any(better) else "none"


def _closes_more(found: Attribution) -> bool:
    """Whether some reported effect explains more than the unexplained residual, relative to joint torques.

    A residual that follows nothing is reported besides the effects, since no motion predicts it, unless it is
    far more; but where half the joints have it, a reported effect is a trace of it. A push leaves it where it
    acted otherwise than was fitted.
    """
    named = [item for item in found.accepted if item.named]
    nothing = {item.joint for item in found.unknown if item.regime == NOTHING}
    pushed = any(item.candidate.is_event for item in named)
    if not pushed and len(nothing) >= max(0.5 * found.prepared.joints, 2):
        return False
    before = rms(found.parameters_only[1].held_out, found.parameters_only[0]) / joint_torque(found.prepared)
    misfits = [
        (LITTLE_CLOSED if item.regime == NOTHING else 1.0) * item.share * before[item.joint] ** 2
        for item in found.unknown
        if item.regime != NOTHING or not pushed
    ]
    return max(item.worth for item in named) > max(misfits, default=0.0)


def joint_torque(prepared: Prepared) -> Array:
    """RMS torque of each joint over all runs, (n,) N·m (N)."""
    return np.sqrt(np.mean(np.concatenate([run.torque for run in prepared.runs]) ** 2, axis=0))
