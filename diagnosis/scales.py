"""Where a shape lies in its range: by its logarithm, unless the range reaches zero."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from .candidates import Candidate

Array = NDArray[np.float64]


def searched(candidate: Candidate, names: Sequence[str]) -> tuple[Array, Array]:
    """The ranges, lower and upper (s,), that some of an effect's shapes are searched in.

    What was taken in is in them, whatever its family looks for once the runs are linearised anew.
    """
    refine, shape = candidate.family.refine, candidate.member.shape
    lower = np.array([min(refine[name][0], shape[name]) for name in names])
    upper = np.array([max(refine[name][1], shape[name]) for name in names])
    return lower, upper


def share_of(values: Array, lower: Array, upper: Array) -> Array:
    """Where values lie between bounds, 0 to 1: by their logarithm, if neither bound is zero or less."""
    shares = np.zeros(len(values))
    for k, (value, low, high) in enumerate(zip(values, lower, upper, strict=True)):
        if high > low:
            shares[k] = np.log(value / low) / np.log(high / low) if low > 0 else (value - low) / (high - low)
    return shares


def within(shares: Array, lower: Array, upper: Array) -> Array:
    """The values of ``share_of``."""
    bounds = zip(shares, lower, upper, strict=True)
    return np.array(
        [low * (high / low) ** u if low > 0 else low + u * (high - low) for u, low, high in bounds]
    )
