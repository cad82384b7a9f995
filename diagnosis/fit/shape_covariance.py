"""Covariance of an effect's coefficients and shapes together, jointly with all else that was fitted.

A shape enters the torque nonlinearly; near what was found its slope is one more column (Gauss-Newton), so the
covariance of all of them is the inverse of their common information.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from testbench.effects.signature import Member

from ..model.candidate import Candidate
from ..model.candidates import candidate
from ..model.hypothesis import Design, scaled_precision
from .normal_equations import Fit
from .shape_search import ranges, share_of, within

Array = NDArray[np.float64]

# To either side, as a share of the range that a shape is searched in.
STEP = 0.01


def covariance_with_shapes(hypothesis: Design, fitted: Fit, index: int) -> Array:
    """Covariance (k + s, k + s) of an effect's k coefficients and the s shapes of its family's ``refine``.

    index: of the effect among those of the hypothesis. A shape that its member has not got has none.
    """
    effect, own = hypothesis.accepted[index], hypothesis.parts[index]
    names = list(effect.family.refine)
    found = np.zeros((effect.count + len(names),) * 2)
    known = [place for place, name in enumerate(names) if name in effect.member.shape]
    if not known or effect.family.member is None:
        found[: effect.count, : effect.count] = fitted.covariance[own, own]
        return found
    slopes = slopes_by_shapes(hypothesis, fitted, index, [names[place] for place in known])
    extended = Design(
        hypothesis.base,
        (*hypothesis.accepted, slopes),
        np.concatenate([hypothesis.precision, np.zeros(slopes.count)]),
    )
    information = extended.weighted(fitted.weights)[0].sum(axis=0)
    information[np.diag_indices_from(information)] += scaled_precision(extended, fitted.prior_scales)
    scale = 1 / np.sqrt(np.maximum(np.diag(information), np.finfo(float).tiny))
    inverse = np.outer(scale, scale) * np.linalg.pinv(information * np.outer(scale, scale), hermitian=True)
    wanted = np.r_[own, extended.parts[-1]]
    place = [*range(effect.count), *(effect.count + each for each in known)]
    found[np.ix_(place, place)] = inverse[np.ix_(wanted, wanted)]
    return found


def slopes_by_shapes(hypothesis: Design, fitted: Fit, index: int, names: Sequence[str]) -> Candidate:
    """Central differences of an effect's filtered torque by some of its shapes, a column each.

    index: of the effect among those of the hypothesis.
    """
    effect, coefficients = hypothesis.accepted[index], fitted.values[hypothesis.parts[index]]
    make, shape = effect.family.member, effect.member.shape
    assert make is not None

    def along(name: str) -> list[Array]:
        lowest, highest = ranges(effect, [name])
        place = share_of(np.array([shape[name]]), lowest, highest)
        low, high = (float(within(np.clip(place + s, 0, 1), lowest, highest)[0]) for s in (-STEP, STEP))
        ends = [
            candidate(hypothesis.prepared, effect.family, make({**shape, name: value})).filtered
            for value in (low, high)
        ]
        return [(b - a) @ coefficients / (high - low) for a, b in zip(*ends, strict=True)]

    free = np.full(len(names), np.inf)
    columns = tuple(np.stack(run, axis=2) for run in zip(*map(along, names), strict=True))
    return replace(effect, member=Member({}, effect.member.rows, (), -free, free), filtered=columns)
