"""Honest covariance: residuals are coloured, so samples count for less than their number."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def variance_inflation(residuals: Sequence[Array], used: Sequence[NDArray[np.bool_]]) -> tuple[Array, Array]:
    """Residual variance (n,) and its inflation 1 + 2 sum rho_k (n,), pooled over runs.

    residuals, used: one (M, n) array a run; unused samples are left out of every product. The
    autocorrelations are summed until a pair of neighbours is no longer positive (Geyer 1992,
    "Practical Markov chain Monte Carlo", initial positive sequence); inflation is at least 1.
    Effective samples are samples / inflation.
    """
    joints = residuals[0].shape[1]
    variance, inflation = np.zeros(joints), np.ones(joints)
    for joint in range(joints):
        series = [np.where(u[:, joint], r[:, joint], 0.0) for r, u in zip(residuals, used, strict=True)]
        present = [u[:, joint].astype(float) for u in used]
        products = _lagged_sum(series)
        pairs = _lagged_sum(present)
        if pairs[0] < 1:
            continue
        variance[joint] = products[0] / pairs[0]
        if variance[joint] == 0:
            continue
        rho = products / np.maximum(pairs, 1.0) / variance[joint]
        # Lags with few pairs are noise; Geyer's rule stops long before a third of the series.
        rho = rho[: max(2, len(rho) // 3)]
        neighbours = rho[0 : len(rho) - len(rho) % 2].reshape(-1, 2).sum(axis=1)
        negative = np.flatnonzero(neighbours <= 0)
        stop = negative[0] if len(negative) else len(neighbours)
        inflation[joint] = max(1.0, 2 * neighbours[:stop].sum() - 1)
    return variance, inflation


def _lagged_sum(series: Sequence[Array]) -> Array:
    """Sum over runs of x[t] x[t + k] for every lag k, by FFT; as long as the longest run."""
    longest = max(len(x) for x in series)
    total = np.zeros(longest)
    for x in series:
        size = 2 * len(x)
        spectrum = np.fft.rfft(x, size)
        total[: len(x)] += np.fft.irfft(spectrum * spectrum.conj(), size)[: len(x)]
    return total
