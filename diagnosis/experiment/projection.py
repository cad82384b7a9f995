"""Least squares against columns of which some are taken out first, in an order that does not vary."""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

RIDGE = 1e-10
BLOCK = 16


def projected_gram(parts: Iterable[Array], base: int) -> Array:
    """Inner products of columns, what the first ``base`` of them span taken out, (c, c).

    parts: the columns' rows (R, c), part by part; all parts but the last have a multiple of BLOCK.
    """
    products = _summed(_products(part) for part in parts)
    norms = np.sqrt(np.diag(products))
    # A column of zeros stays one, whatever it is divided by.
    norms = np.where(norms > 0, norms, 1.0)
    gram = products / np.outer(norms, norms)
    inner = gram[:base, :base] + RIDGE * np.eye(base)
    return np.asarray((gram - gram[:, :base] @ np.linalg.solve(inner, gram[:base])) * np.outer(norms, norms))


def _products(rows: Array) -> Array:
    """Products (B, c, c) of BLOCK rows each: too small for BLAS to share among threads and reorder."""
    blocks = np.zeros((-(-len(rows) // BLOCK), BLOCK, rows.shape[1]))
    blocks.reshape(-1, rows.shape[1])[: len(rows)] = rows
    return blocks.transpose(0, 2, 1) @ blocks


def _summed(parts: Iterable[Array]) -> Array:
    """Sum along the first axis of all parts, in their order whatever the parts are."""
    total: Array | None = None
    for part in parts:
        total = np.sum(part if total is None else np.concatenate([total[None], part]), axis=0)
    assert total is not None
    return total


def _nearest(gram: Array, y: int, span: slice) -> Array:
    """Coefficients (k,) of the columns ``span`` that come nearest to column ``y``."""
    inner = gram[span, span]
    scale = np.sqrt(np.maximum(np.diag(inner), np.finfo(float).tiny))
    scaled = inner / np.outer(scale, scale) + RIDGE * np.eye(len(scale))
    return np.asarray(np.linalg.solve(scaled, gram[span, y] / scale) / scale)


def left(gram: Array, y: int, span: slice) -> float:
    """Squared length of what the columns ``span`` leave of column ``y``."""
    return float(gram[y, y] - gram[span, y] @ _nearest(gram, y, span))
