"""Honest covariance: residuals are coloured, so samples count for less than their number."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft, next_fast_len, rfft

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
    all_products = _lagged_sum([np.where(u, r, 0.0) for r, u in zip(residuals, used, strict=True)])
    all_pairs = _lagged_sum([u.astype(float) for u in used])
    for joint, (products, pairs) in enumerate(zip(all_products.T, all_pairs.T, strict=True)):
        # Half a pair is rounding.
        if pairs[0] < 0.5:
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
    """Sum over runs (M, n) of x[t] x[t + k] for every lag k, by FFT: (longest run, n)."""
    longest = max(len(x) for x in series)
    size = next_fast_len(2 * longest, real=True)
    spectra = [rfft(x, size, axis=0) for x in series]
    power = np.sum([spectrum.real**2 + spectrum.imag**2 for spectrum in spectra], axis=0)
    total: Array = irfft(power, size, axis=0)[:longest]
    return total
