"""How far an estimate may move from the model as given, by what it predicts of runs that were left out.

Least squares with a Gaussian prior about the model: (sum_j w_j² X_j'X_j + s P) change = sum_j w_j² X_j'y_j,
with y the torque less the model's, X_j the rows of joint j, P the inverse of the prior's covariance. Its
strength s is the largest that predicts left-out rows as well as any; then one factor scales the change as a
whole. The squared error is convex in that factor and the model is factor 0, so left-out rows are never
predicted worse.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# Strengths of the prior that are tried, strongest first: 1 takes its widths at their word, the last allows
# ten times as much. Weaker, what the runs hardly tell would be let loose.
STRENGTHS = (1.0, 0.3, 0.1, 0.03, 0.01)
# A left-out error this much above the least is no reason to let parameters further from the model.
INDIFFERENCE = 0.01


@dataclass(frozen=True)
class Products:
    """Sums of products over the rows of F folds and n joints, p unknowns.

    xx: (F, n, p, p) X'X. xy: (F, n, p) X'y. yy: (F, n) y'y. y: torque less the model's, so no change is the
    model as given.
    """

    xx: Array
    xy: Array
    yy: Array

    def weighted(self, weights: Array) -> tuple[Array, Array, Array]:
        """The same summed over joints whose rows are multiplied by weights (n,): (F, p, p), (F, p), (F,)."""
        squared = weights**2
        return (
            np.einsum("j,fjab->fab", squared, self.xx),
            np.einsum("j,fja->fa", squared, self.xy),
            self.yy @ squared,
        )


@dataclass(frozen=True)
class Shrinkage:
    """strength: of the prior. factor: 0 to 1, on the change as a whole.

    errors: (m, 3) left-out RMS error of each measure over that of the model as given: of the weakest
    prior, of the chosen one, and with the factor.
    """

    strength: float
    factor: float
    errors: Array


def shrinkage(products: Products, weights: Array, precision: Array, measures: Sequence[Array]) -> Shrinkage:
    """The prior's strength and the factor for a fit with these weights, by leaving out each fold in turn.

    weights: (n,) of each joint's rows in the fit. precision: (p, p), the prior's inverse covariance in units
    of the weighted rows' noise. measures: (n,) weights each of a squared error; their shares of the model's
    own are averaged, geometrically for the strength, and none may exceed it.
    """
    tried = [left_out_changes(products, weights, precision, strength) for strength in STRENGTHS]
    shares = np.array([[_share(products, measure, changes) for measure in measures] for changes in tried])
    # Of a geometric mean no measure that nothing changes hides what another gains.
    scores = np.exp(np.log(np.maximum(shares, np.finfo(float).tiny)).mean(axis=1))
    near = scores <= (1 + INDIFFERENCE) ** 2 * scores.min()
    chosen = int(np.argmax(near))
    changes = tried[chosen]
    factor = shrinkage_factor(products, measures, np.zeros_like(changes), changes)
    final = [_share(products, measure, factor * changes) for measure in measures]
    return Shrinkage(STRENGTHS[chosen], factor, np.sqrt(np.column_stack([shares[-1], shares[chosen], final])))


def left_out_changes(products: Products, weights: Array, precision: Array, strength: float) -> Array:
    """Changes (F, p) of the model that are estimated without each fold."""
    xx, xy, _ = products.weighted(weights)
    return np.stack(
        [
            held_change(xx.sum(axis=0) - own, xy.sum(axis=0) - moment, precision, strength)
            for own, moment in zip(xx, xy, strict=True)
        ]
    )


def held_change(xx: Array, xy: Array, precision: Array, strength: float) -> Array:
    """(xx + strength precision)^-1 xy, (p,), in the prior's own units where it is well conditioned."""
    root = np.linalg.cholesky(precision)
    inner = np.linalg.solve(root, np.linalg.solve(root, xx).T)
    values, vectors = np.linalg.eigh(0.5 * (inner + inner.T))
    scaled = vectors.T @ np.linalg.solve(root, xy) / (np.maximum(values, 0.0) + strength)
    return np.asarray(np.linalg.solve(root.T, vectors @ scaled), dtype=np.float64)


def shrinkage_factor(products: Products, measures: Sequence[Array], start: Array, end: Array) -> float:
    """The factor a in [0, 1] of start + a (end - start), (F, p) each, of least left-out error.

    The measures' squared errors are averaged as shares of their error at ``start``, and none may exceed it.
    """
    step = end - start
    slope, curvature = np.zeros(len(measures)), np.zeros(len(measures))
    for index, measure in enumerate(measures):
        xx, xy, _ = products.weighted(measure)
        before = max(_square(products, measure, start), np.finfo(float).tiny)
        slope[index] = np.sum(step * (xy - np.einsum("fab,fb->fa", xx, start))) / before
        curvature[index] = np.einsum("fa,fab,fb->", step, xx, step) / before
    if np.any(slope <= 0) or curvature.sum() <= 0:
        return 0.0
    # A measure's error is back at its start at twice its own best factor.
    bounds = 2 * slope[curvature > 0] / curvature[curvature > 0]
    return float(min(1.0, slope.sum() / curvature.sum(), bounds.min()))


def _square(products: Products, measure: Array, changes: Array) -> float:
    """Left-out squared error, summed over folds."""
    xx, xy, yy = products.weighted(measure)
    quadratic = np.einsum("fa,fab,fb->", changes, xx, changes)
    return float(max(yy.sum() - 2 * np.sum(changes * xy) + quadratic, 0.0))


def _share(products: Products, measure: Array, changes: Array) -> float:
    """Left-out squared error over that of the model as given; 1 where the model leaves none."""
    given = _square(products, measure, np.zeros_like(changes))
    return _square(products, measure, changes) / given if given > 0 else 1.0
