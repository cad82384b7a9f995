"""Least squares against columns of which some are taken out first, in an order that does not vary."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

RIDGE = 1e-10
BLOCK = 16


def projected_gram(columns: Array, base: int) -> Array:
    """Inner products of the columns (R, c), what the first ``base`` of them span taken out, (c, c)."""
    norms = np.maximum(np.linalg.norm(columns, axis=0), np.finfo(float).tiny)
    scaled = columns / norms
    # Products too small for BLAS to share among threads, which could change the order of its sums.
    blocks = np.zeros((-(-len(scaled) // BLOCK), BLOCK, scaled.shape[1]))
    blocks.reshape(-1, scaled.shape[1])[: len(scaled)] = scaled
    gram = np.sum(blocks.transpose(0, 2, 1) @ blocks, axis=0)
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
