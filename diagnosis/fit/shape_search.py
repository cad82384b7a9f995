"""An effect's shapes searched in their ranges: by their logarithms, unless a range reaches zero."""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from testbench.effects.signature import Member

from ..model.candidate import Candidate

Array = NDArray[np.float64]

# Where the search ends: shapes this close, as a share of their ranges, that are as good but for so much.
CLOSE, AS_GOOD = 1e-3, 0.05


def search(each: Candidate, steps: Array, tried: int, negative: Callable[[Member], float]) -> None:
    """Nelder and Mead's simplex through an effect's shapes, from where they are.

    steps: (s,) the first, as shares of the ranges. tried: so many members. negative: what is to be small of
    a member; it keeps the best.
    """
    make, shape, names = each.family.member, each.member.shape, searched_for(each)
    assert make is not None
    lower, upper = ranges(each, names)

    def at(u: Array) -> float:
        values = within(np.clip(u, 0, 1), lower, upper).tolist()
        return negative(make({**shape, **dict(zip(names, values, strict=True))}))

    start = share_of(np.array([shape[name] for name in names]), lower, upper)
    # Inward from the end of a range.
    simplex = np.vstack([start, start + np.diag(np.where(start + steps > 1, -steps, steps))])
    minimize(
        at,
        start,
        method="Nelder-Mead",
        options={"maxfev": tried, "initial_simplex": simplex, "xatol": CLOSE, "fatol": AS_GOOD},
    )


def searched_for(each: Candidate) -> list[str]:
    """The shapes of an effect that are searched for, of those that its member has."""
    return [name for name in each.family.refine if name in each.member.shape]


def ranges(each: Candidate, names: Sequence[str]) -> tuple[Array, Array]:
    """The ranges, lower and upper (s,), that some of an effect's shapes are searched in.

    The accepted shape is in them, whatever its family looks for once the runs are linearised anew.
    """
    refine, shape = each.family.refine, each.member.shape
    lower = np.array([min(refine[name][0], shape[name]) for name in names])
    upper = np.array([max(refine[name][1], shape[name]) for name in names])
    return lower, upper


def share_of(values: Array, lower: Array, upper: Array) -> Array:
    """Position of values between bounds, 0 to 1: by their logarithm, if neither bound is zero or less."""
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
