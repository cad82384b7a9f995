"""Shapes of effects by all runs: the likeliest, once it is known which effects act.

While effects are searched for, one after the other, a shape is judged by runs left out. These show well which
law holds; how large its shapes are is best estimated from all runs together, with all other effects fitted.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from testbench.effects.signature import Member
from testbench.robot import Robot

from ..model.candidate import Candidate
from ..model.candidates import candidate
from ..model.effect_sizes import is_plausible
from ..model.hypothesis import Design, design
from .likelihood import likeliest_of
from .normal_equations import Fit, fit, fitted_to
from .score import Stage
from .shape_covariance import STEP, covariance_with_shapes, slopes_by_shapes
from .shape_search import ranges, search, searched_for, share_of

Array = NDArray[np.float64]

# All effects in turn, again where there are several, as the shapes of one move those of another.
PASSES = 2
# The largest first step, as a share of a shape's range; the smallest is that of its derivatives.
MOST_STEP = 0.1
# Shapes tried a pass, for one of a member's shapes and for each more.
TRIED = 12


def at_likeliest_shapes(robot: Robot, hypothesis: Design, fitted: Fit) -> tuple[Design, Fit]:
    """The hypothesis with every shape where all runs together have it likeliest; and its fit.

    robot: that sizes are relative to. A delay has its exact size already.
    """
    searched = sum(is_searched(each) for each in hypothesis.accepted)
    for _ in range(min(searched, PASSES)):
        refined = [
            at_likeliest_shape(robot, hypothesis, fitted, place) if is_searched(each) else each
            for place, each in enumerate(hypothesis.accepted)
        ]
        hypothesis, fitted = fitted_to(hypothesis.base, refined)
    return hypothesis, fitted


def after_a_step(robot: Robot, hypothesis: Design, fitted: Fit, places: Sequence[int]) -> tuple[Design, Fit]:
    """The hypothesis with some effects' shapes a Gauss-Newton step on, where that is likelier; and its fit.

    A search ends where shapes are as good but for a little: their deviations may be less than what it leaves.
    robot: that sizes are relative to. places: of the effects.
    """
    prepared, last = hypothesis.prepared, fitted
    for place in places:
        each = hypothesis.accepted[place]
        if not is_searched(each):
            continue
        assert each.family.member is not None
        shaped = each.family.member(_stepped(hypothesis, last, place))
        stepped = candidate(prepared, each.family, shaped)
        trial = design(
            hypothesis.base, [*hypothesis.accepted[:place], stepped, *hypothesis.accepted[place + 1 :]]
        )
        found = fit(trial, like=last)
        is_likelier = found.objective < last.objective
        if is_likelier and is_plausible(robot, stepped, found.values[trial.parts[place]]):
            hypothesis, last = trial, found
    return (hypothesis, fitted) if last is fitted else fitted_to(hypothesis.base, hypothesis.accepted)


def _stepped(hypothesis: Design, fitted: Fit, place: int) -> dict[str, float]:
    """An effect's shape after one Gauss-Newton step jointly with all else, within its ranges."""
    each = hypothesis.accepted[place]
    names = searched_for(each)
    slopes = slopes_by_shapes(hypothesis, fitted, place, names)
    step = Stage(hypothesis, fitted).exactly(slopes)
    if step is None:
        return dict(each.member.shape)
    stepped = np.clip(np.array([each.member.shape[name] for name in names]) + step[1], *ranges(each, names))
    return {**each.member.shape, **dict(zip(names, stepped.tolist(), strict=True))}


def is_searched(each: Candidate) -> bool:
    """Whether an effect has shapes that are searched for."""
    return each.family.member is not None and not each.is_common_delay and bool(searched_for(each))


def at_likeliest_shape(robot: Robot, hypothesis: Design, fitted: Fit, place: int) -> Candidate:
    """An effect at the likeliest of its shapes, with the others kept as they are."""
    each, prepared = hypothesis.accepted[place], hypothesis.prepared
    others = design(hypothesis.base, [*hypothesis.accepted[:place], *hypothesis.accepted[place + 1 :]])
    # By the weights of the whole: without the effect its joint would seem to be the noisier.
    stage = Stage(others, fit(others, like=fitted))
    before = stage.exactly(each)
    if before is None:
        return each
    each, most = _by_another_way(robot, stage, each, before[0])
    best = each

    def negative(shaped: Member) -> float:
        nonlocal best, most
        tried = candidate(prepared, each.family, shaped)
        found = stage.exactly(tried)
        if found is None or not is_plausible(robot, tried, found[1]):
            return 0.0
        if found[0] > most:
            best, most = tried, found[0]
        return -found[0]

    steps = np.clip(_deviations(hypothesis, fitted, place), STEP, MOST_STEP)
    search(each, steps, TRIED * len(steps), negative)
    return best


def _by_another_way(robot: Robot, stage: Stage, each: Candidate, most: float) -> tuple[Candidate, float]:
    """An effect, or the member of its family that is likelier yet; and what ``Stage.exactly`` says of it.

    Members of one family may differ in more than the shapes that are searched for, as a joint warms by heat
    or by the clock: beside other effects another way may be the right one. most: of ``each``.
    """
    if not each.family.differs_in_kind:
        return each, most
    for likely in likeliest_of(stage, each.family, each.family.members):
        exact = stage.exactly(likely.candidate)
        if exact is not None and exact[0] > most and is_plausible(robot, likely.candidate, exact[1]):
            return likely.candidate, exact[0]
    return each, most


def _deviations(hypothesis: Design, fitted: Fit, place: int) -> Array:
    """Standard deviations of an effect's shapes, (s,) as shares of their ranges."""
    each = hypothesis.accepted[place]
    names = searched_for(each)
    variances = np.diag(covariance_with_shapes(hypothesis, fitted, place))[each.count :]
    known = dict(zip(each.family.refine, np.sqrt(np.maximum(variances, 0.0)), strict=True))
    values, spread = (np.array([of[name] for name in names]) for of in (each.member.shape, known))
    bounds = ranges(each, names)
    return share_of(values + spread, *bounds) - share_of(values, *bounds)
