"""Least squares against columns of which some are taken out first."""

from collections.abc import Iterable
from functools import reduce
from operator import add

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

RIDGE = 1e-10


def projected_gram(parts: Iterable[Array], base: int) -> Array:
    """Inner products of columns, what the first ``base`` of them span taken out, (c, c).

    parts: the columns' rows (R, c), part by part.
    """
    products = reduce(add, (part.T @ part for part in parts))
    norms = np.sqrt(np.diag(products))
    # A column of zeros stays one, whatever it is divided by.
    norms = np.where(norms > 0, norms, 1.0)
    gram = products / np.outer(norms, norms)
    inner = gram[:base, :base] + RIDGE * np.eye(base)
    return np.asarray((gram - gram[:, :base] @ np.linalg.solve(inner, gram[:base])) * np.outer(norms, norms))


def _nearest(gram: Array, y: int, span: slice) -> Array:
    """Coefficients (k,) of the columns ``span`` that come nearest to column ``y``."""
    inner = gram[span, span]
    scale = np.sqrt(np.maximum(np.diag(inner), np.finfo(float).tiny))
    scaled = inner / np.outer(scale, scale) + RIDGE * np.eye(len(scale))
    return np.asarray(np.linalg.solve(scaled, gram[span, y] / scale) / scale)


def left(gram: Array, y: int, span: slice) -> float:
    """Squared length of what the columns ``span`` leave of column ``y``."""
    return float(gram[y, y] - gram[span, y] @ _nearest(gram, y, span))
