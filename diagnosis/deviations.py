"""How well an effect is known: its coefficients and its shapes together, beside all else that was fitted.

A shape enters the torque nonlinearly; near what was found its slope is one more column (Gauss-Newton), so the
covariance of all of them is the inverse of their common information.
"""

import numpy as np
from numpy.typing import NDArray

from .candidates import Candidate, candidate
from .evidence import Design, Fit, Normal, scaled_precision
from .ground import ground

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
    slopes = [_slope(hypothesis, effect, fitted.values[own], names[place]) for place in known]
    rows = ground(hypothesis.prepared).rows(
        [np.stack([slope[run] for slope in slopes], axis=2) for run in range(len(hypothesis.gap))]
    )
    first = len(fitted.values)
    information = np.zeros((first + len(known),) * 2)
    information[:first, :first] = Normal(hypothesis).weighted(fitted.weights)[0].sum(axis=0)
    information[range(first), range(first)] += scaled_precision(hypothesis, fitted.prior_scale)
    base, added = ground(hypothesis.prepared), hypothesis.added_rows()
    for fold, of_joints in enumerate(rows):
        for joint, (weight, z) in enumerate(zip(fitted.weights, of_joints, strict=True)):
            x = np.concatenate([base.x[fold][joint], added[fold][joint]], axis=1)
            information[first:, :first] += weight * z.T @ x
            information[first:, first:] += weight * z.T @ z
    information[:first, first:] = information[first:, :first].T
    scale = 1 / np.sqrt(np.maximum(np.diag(information), np.finfo(float).tiny))
    inverse = np.outer(scale, scale) * np.linalg.pinv(information * np.outer(scale, scale), hermitian=True)
    wanted = [*range(own.start, own.stop), *range(first, first + len(known))]
    place = [*range(effect.count), *(effect.count + each for each in known)]
    found[np.ix_(place, place)] = inverse[np.ix_(wanted, wanted)]
    return found


def _slope(hypothesis: Design, effect: Candidate, coefficients: Array, name: str) -> list[Array]:
    """Central difference of an effect's filtered torque by one of its shapes, a run (M, n)."""
    make, shape = effect.family.member, effect.member.shape
    assert make is not None
    lowest, highest = effect.family.refine[name]
    step = STEP * (highest - lowest)
    low, high = max(shape[name] - step, lowest), min(shape[name] + step, highest)
    ends = [
        candidate(hypothesis.prepared, effect.family, make({**shape, name: value})).columns
        for value in (low, high)
    ]
    return [(b - a) @ coefficients / (high - low) for a, b in zip(*ends, strict=True)]
