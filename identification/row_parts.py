"""Norms and the QR factor of a matrix that is made in parts, of which only one is held at a time."""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def column_norms(parts: Iterable[Array]) -> Array:
    """Euclidean norms of the columns of parts (K, b) one below the other, (b,)."""
    return np.asarray(np.linalg.norm([np.linalg.norm(part, axis=0) for part in parts], axis=0))


def triangle(parts: Iterable[Array]) -> Array:
    """R of the QR decomposition of parts (K, b) one below the other, at most (b, b); Q is never formed.

    Golub & Van Loan, "Matrix computations", 2013, section 5.2: R of [R of what came before; the next part].
    """
    upper: Array | None = None
    for part in parts:
        upper = np.asarray(np.linalg.qr(part if upper is None else np.vstack([upper, part]), mode="r"))
    assert upper is not None
    return upper
