"""Shapes of effects by all runs: the likeliest, once it is known which effects act.

While effects are sought, one after the other, a shape is judged by runs left out. Which law holds they tell
well; how large its shapes are is told best by all runs together, beside all other effects.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from testbench.robot import Robot

from .candidates import Candidate, candidate
from .deviations import covariance_with_shapes
from .evidence import DELAY, Design, Fit, design, fit, fitted_to
from .ground import ground
from .healthy import is_plausible
from .scales import searched, share_of, within
from .weighing import Stage

Array = NDArray[np.float64]

# All effects in turn, again where there are several, as the shapes of one move those of another: the least
# first step of each pass, as a share of a shape's range.
LEAST_STEPS = (0.02, 0.003)
# And what it is else: standard deviations of the shape, and the most.
DEVIATIONS, MOST_STEP = 1.5, 0.1
# Shapes tried a pass, for one of a member's shapes and for each more.
TRIED = 12


def at_likeliest_shapes(robot: Robot, hypothesis: Design, fitted: Fit) -> tuple[Design, Fit]:
    """The hypothesis with every shape where all runs together have it likeliest; and its fit.

    robot: that sizes are relative to. A delay has its exact size already.
    """
    places = range(len(hypothesis.accepted))
    several = sum(bool(_searched_for(each)) for each in hypothesis.accepted) > 1
    for least_step in LEAST_STEPS if several else LEAST_STEPS[:1]:
        refined = [_refined(robot, hypothesis, fitted, place, least_step) for place in places]
        hypothesis, fitted = fitted_to(hypothesis.prepared, refined)
    return hypothesis, fitted


def _searched_for(each: Candidate) -> list[str]:
    """The shapes of an effect that are searched for."""
    is_sized = each.family.member is None or each.family.effect == DELAY
    return [] if is_sized else [name for name in each.family.refine if name in each.member.shape]


def _refined(robot: Robot, hypothesis: Design, fitted: Fit, place: int, least_step: float) -> Candidate:
    """An effect at the likeliest of its shapes, beside the others as they are."""
    each = hypothesis.accepted[place]
    family, shape = each.family, each.member.shape
    names, make = _searched_for(each), family.member
    if not names or make is None:
        return each
    prepared = hypothesis.prepared
    others = design(prepared, [*hypothesis.accepted[:place], *hypothesis.accepted[place + 1 :]])
    # By the weights of the whole: without the effect its joint would seem to be the noisier.
    stage = Stage(ground(prepared), others, fit(prepared, others, like=fitted))
    before = stage.gain(each)
    if before is None:
        return each
    lower, upper = searched(each, names)
    best, most = each, before.objective

    def negative(u: Array) -> float:
        nonlocal best, most
        values = within(np.clip(u, 0, 1), lower, upper).tolist()
        member = make({**shape, **dict(zip(names, values, strict=True))})
        gain = stage.gain(candidate(prepared, family, member))
        if gain is None or not is_plausible(robot, gain.candidate, gain.coefficients):
            return 0.0
        if gain.objective > most:
            best, most = gain.candidate, gain.objective
        return -gain.objective

    start = share_of(np.array([shape[name] for name in names]), lower, upper)
    step = np.clip(_deviations(hypothesis, fitted, place, names), least_step, MOST_STEP)
    simplex = np.vstack([start, start + np.diag(np.where(start + step > 1, -step, step))])
    tried = TRIED * len(names)
    minimize(negative, start, method="Nelder-Mead", options={"maxfev": tried, "initial_simplex": simplex})
    return best


def _deviations(hypothesis: Design, fitted: Fit, place: int, names: Sequence[str]) -> Array:
    """So many standard deviations of the shapes, as shares of their ranges."""
    each = hypothesis.accepted[place]
    shape = each.member.shape
    variances = np.diag(covariance_with_shapes(hypothesis, fitted, place))[each.count :]
    known = dict(zip(each.family.refine, DEVIATIONS * np.sqrt(np.maximum(variances, 0.0)), strict=True))
    lower, upper = searched(each, names)
    ends = [np.array([shape[name] + times * float(known[name]) for name in names]) for times in (0.0, 1.0)]
    return share_of(ends[1], lower, upper) - share_of(ends[0], lower, upper)
