"""Units and quantities by what the values can be: against the model's limits, and against each other."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..joints import Joints
from ..units import TURN, UNITS
from ..wraps import unwrapped

Array = NDArray[np.float64]

# Samples that may lie anywhere, as a share of each end.
STRAY = 0.005
# A hinge goes no further beyond its range than this, as a share of it, rad for one without.
BEYOND, ENDLESS = 0.1, 2 * TURN
# A slide joint without a range is no longer than so many metres.
LONGEST = 5.0
# Torque peaks lie within this share of the model's limits; beyond the other they are in thousandths.
MOST_TORQUE, THOUSANDFOLD = 3.0, 10.0
# Amperes that no joint of an arm draws.
MOST_AMPERES = 60.0
# A velocity goes with the derivative of the position so well, and is so near to it, as a factor.
GOES_WITH, NEARLY = 0.7, 1.3
SAME = 0.99
# Samples that are compared, at most.
COMPARED = 20_000
# A joint moves that covers more than this, rad or m.
MOVES = 0.01


def position_units(values: Array, joints: Joints) -> tuple[str | tuple[str, ...], str]:
    """The unit of positions (N, n), one for all hinges and one for all slides, and why."""
    slides = np.asarray(joints.is_slide)
    found = {False: ("rad", ""), True: ("m", "")}
    for is_slide in (False, True):
        if np.any(slides == is_slide):
            found[is_slide] = _position_unit(values[:, slides == is_slide], joints, is_slide)
    if slides.any() and not slides.all():
        return tuple(found[bool(slide)][0] for slide in slides), "; ".join(why for _, why in found.values())
    return found[bool(slides.all())]


def _position_unit(values: Array, joints: Joints, is_slide: bool) -> tuple[str, str]:
    of = np.asarray(joints.is_slide) == is_slide
    lower, upper = joints.lower[of], joints.upper[of]
    known = values[np.isfinite(values).all(axis=1)]
    low, high = _ends(known)
    candidates = ("m", "mm", "cm") if is_slide else ("rad", "deg")
    for unit in candidates:
        own = known * UNITS["position"][is_slide][unit]
        ends = _ends(own if is_slide else unwrapped(own))
        if _fits(*ends, lower, upper, LONGEST if is_slide else ENDLESS):
            within = (
                "within the model's ranges" if np.isfinite(upper - lower).any() else "as far as joints turn"
            )
            if is_slide:
                within = within.replace("turn", "slide")
            return unit, f"{low.min():.3g} to {high.max():.3g} is {within} in {unit}"
    return candidates[
        0
    ], f"{low.min():.3g} to {high.max():.3g} is beyond the model's ranges in any unit: check"


def _ends(values: Array) -> tuple[Array, Array]:
    """Between which values (n,) nearly all of these (N, n) lie."""
    low, high = np.nanquantile(values, [STRAY, 1 - STRAY], axis=0)
    return low, high


def _fits(low: Array, high: Array, lower: Array, upper: Array, endless: float) -> bool:
    """Whether all joints stay about their ranges; a whole number of turns away counts as well."""
    limited = np.isfinite(lower) & np.isfinite(upper)
    lower, upper = np.where(limited, lower, 0.0), np.where(limited, upper, 0.0)
    margin = BEYOND * (upper - lower)
    turns = np.zeros_like(low)
    if endless == ENDLESS:
        turns = TURN * np.round(np.where(limited, ((low + high) - (lower + upper)) / 2, 0.0) / TURN)
        # A turn is as far as a counter that was not reset is off.
        turns = np.where(np.abs(turns) <= TURN, turns, 0.0)
    inside = (low - turns >= lower - margin) & (high - turns <= upper + margin)
    return bool(np.all(np.where(limited, inside, np.maximum(np.abs(low), np.abs(high)) <= endless)))


def turns_off(position: Array, joints: Joints) -> Array:
    """Radians (n,), whole turns, by which positions (N, n) lie beside the model's ranges."""
    low, high = _ends(position)
    limited = np.isfinite(joints.lower) & np.isfinite(joints.upper) & ~np.asarray(joints.is_slide)
    lower, upper = (np.where(limited, bound, 0.0) for bound in (joints.lower, joints.upper))
    margin = BEYOND * (upper - lower)
    outside = limited & ((low < lower - margin) | (high > upper + margin))
    off = np.where(outside, TURN * np.round(((low + high) - (lower + upper)) / 2 / TURN), 0.0)
    fits = (low - off >= lower - margin) & (high - off <= upper + margin)
    return np.where(fits, off, 0.0)


def velocity_unit(values: Array, position: Array, time: Array, is_slide: bool) -> tuple[str, str]:
    """The unit in which velocities (N, n) are the derivative of positions (N, n), SI, and why."""
    every = max(1, len(time) // COMPARED)
    derivative = np.gradient(position, time, axis=0)[::every]
    own = values[::every]
    moving = np.ptp(position, axis=0) > MOVES
    if not moving.any():
        return next(iter(UNITS["velocity"][is_slide])), "no joint moves, which leaves the unit open"
    together = [_correlation(own[:, joint], derivative[:, joint]) for joint in np.flatnonzero(moving)]
    if np.median(together) < GOES_WITH:
        got = f"correlation {np.median(together):.2f}"
        return "", f"it does not go with the derivative of the position ({got})"
    one, other = own[:, moving].ravel(), derivative[:, moving].ravel()
    known = np.isfinite(one) & np.isfinite(other)
    slope = float(one[known] @ other[known] / (one[known] @ one[known]))
    units = UNITS["velocity"][is_slide]
    unit = min(units, key=lambda unit: abs(np.log(units[unit] / slope)))
    if abs(np.log(units[unit] / slope)) > np.log(NEARLY):
        return "", f"it is {1 / slope:.3g} times the derivative of the position, which is no unit"
    return unit, "as the derivative of the position says"


def is_position_again(values: Array, position: Array, factor: float) -> bool:
    """Whether values (N, n) are about the positions (N, n), SI, themselves: where to go, not how fast."""
    moving = np.flatnonzero(np.ptp(position, axis=0) > MOVES)
    if not len(moving):
        return False
    return bool(
        np.median([_correlation(values[:, joint] * factor, position[:, joint]) for joint in moving]) > SAME
    )


def _correlation(one: Array, other: Array) -> float:
    known = np.isfinite(one) & np.isfinite(other)
    if np.sum(known) < 3 or np.std(one[known]) == 0 or np.std(other[known]) == 0:
        return 0.0
    return float(np.corrcoef(one[known], other[known])[0, 1])


def torque_unit(values: Array, joints: Joints) -> tuple[str, str]:
    """The unit of torques (N, n) by the model's limits, and why."""
    hinge = not all(joints.is_slide)
    units: Sequence[str] = ("N·m", "mN·m") if hinge else ("N", "mN")
    limited = np.isfinite(joints.torque)
    if not limited.any():
        return units[0], "by default"
    peaks = np.nanquantile(np.abs(values[:, limited]), 1 - STRAY, axis=0) / joints.torque[limited]
    share = float(np.median(peaks))
    if share <= MOST_TORQUE:
        return units[0], f"peaks are {share:.0%} of the model's limits"
    if share > THOUSANDFOLD and share * 1e-3 <= MOST_TORQUE:
        return units[1], f"in {units[0]} peaks were {share:.3g} times the model's limits"
    return units[0], f"peaks are {share:.3g} times the model's limits: check the unit"


def drive_unit(quantity: str, values: Array) -> tuple[str, str]:
    """The unit of currents, duties or voltages (N, n), and why; empty where none is likely."""
    peak = float(np.nanquantile(np.abs(values), 1 - STRAY))
    if quantity == "current":
        unit = "mA" if peak > MOST_AMPERES else "A"
        return unit, f"peaks of {peak:.3g}"
    if quantity == "voltage":
        return "V", f"peaks of {peak:.3g}"
    for unit, factor in UNITS["duty"][0].items():
        if peak * factor <= 1.05:
            return unit, f"peaks of {peak:.3g}"
    return "", f"peaks of {peak:.3g} are in no known unit of duty: say its scale in a map"


def lost_its_sign(values: Array, position: Array) -> bool:
    """Whether values (N, n) are never below zero though the joints move either way."""
    both_ways = (np.diff(position, axis=0).min(axis=0) < 0) & (np.diff(position, axis=0).max(axis=0) > 0)
    moves = both_ways & (np.ptp(position, axis=0) > MOVES)
    return bool(moves.any() and np.nanmin(values[:, moves]) >= 0)
