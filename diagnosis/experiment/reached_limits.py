"""Limits for the next experiment where a model sets too few: what the runs at hand have reached."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from identification.excitation.limits import JointLimits, Limits, missing_limits
from testbench.effects.logged import Logged

Array = NDArray[np.float64]

# Share of the samples that may lie beyond what counts as reached: a spike is no motion.
SPIKES = 1e-3


def within_reach(limits: Limits, runs: Sequence[Logged]) -> tuple[Limits, bool]:
    """The limits, and what the runs reached of all that joints with too few of them lack; whether any does.

    Too few are those that ``missing_limits`` names, and those without a rated speed.
    """
    no_range, no_bound = missing_limits(limits)
    unrated = ~np.isfinite(limits.velocity)
    if not np.any(no_range | no_bound | unrated):
        return limits, False
    q, dq, ddq, tau = (
        np.concatenate([getattr(run, name) for run in runs]) for name in ("q", "dq", "ddq", "tau")
    )

    def bounded(limit: Array, reached: Array, lacking: NDArray[np.bool_] = no_bound) -> Array:
        largest = np.quantile(np.abs(reached), 1 - SPIKES, axis=0)
        return np.where(lacking & ~np.isfinite(limit), largest, limit)

    filled = JointLimits(
        np.where(no_range, np.min(q, axis=0), limits.lower),
        np.where(no_range, np.max(q, axis=0), limits.upper),
        bounded(limits.velocity, dq, unrated),
        bounded(limits.acceleration, ddq),
        bounded(limits.torque, tau),
    )
    return filled, True
