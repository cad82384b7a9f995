"""RLOESS: robust local quadratic regression of equally spaced samples.

Cleveland (1979), "Robust locally weighted regression and smoothing scatterplots", as the source
uses it: a quadratic fitted around each sample with tricube weights (1 - |d|³)³, then five passes
in which each sample also carries a bisquare weight (1 - (r / 6 MAD)²)² of its last residual r.
MAD is the median absolute residual of the whole series. Windows are cut off at the ends.
"""

import os
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numpy.typing import NDArray

from .kinematics import kernel

Array = NDArray[np.float64]

ROBUST_PASSES = 5
# Six median absolute deviations: residuals beyond count nothing.
CUTOFF_IN_MAD = 6.0
# Samples whose eight sums stay in the first-level cache together.
BLOCK = 128


def rloess(x: Array, window: int) -> Array:
    """Smooth each column of x (N, n) over ``window`` samples (odd; the next odd number when even).

    Returns (N, n). A window of N or more is cut to the series; below 5 samples x is returned.
    """
    half = min(window, len(x)) // 2
    if half < 2:
        return x.copy()
    out = np.empty_like(x)

    def smooth(column: int) -> None:
        out[:, column] = _smooth(np.ascontiguousarray(x[:, column]), half)

    with ThreadPoolExecutor(min(os.cpu_count() or 1, x.shape[1])) as pool:
        list(pool.map(smooth, range(x.shape[1])))
    return out


def _smooth(series: Array, half: int) -> Array:
    """One column (N,) smoothed over half samples on each side."""
    distance = np.arange(half + 1) / (half + 1)
    kernels = (1 - distance**3) ** 3 * (np.arange(half + 1) / half) ** np.arange(5)[:, None]
    rounding = 1e-12 * np.max(np.abs(series))
    robust = np.ones(len(series))
    smooth = _local_quadratic(series, robust, kernels)
    for _ in range(ROBUST_PASSES):
        residual = np.abs(series - smooth)
        scale = CUTOFF_IN_MAD * np.median(residual)
        # A series that is already smooth to rounding has no outliers to find.
        if scale <= rounding:
            break
        robust = np.maximum(1 - (residual / scale) ** 2, 0) ** 2
        smooth = _local_quadratic(series, robust, kernels)
    return smooth


def _local_quadratic(y: Array, robust: Array, kernels: Array) -> Array:
    """Value (N,) at each sample of the weighted quadratic through the samples around it."""
    half = kernels.shape[1] - 1
    # No weight beyond the ends cuts the window off there.
    s0, s1, s2, s3, s4, b0, b1, b2 = _moments(np.pad(robust, half), np.pad(robust * y, half), kernels)
    # Cramer's rule for the constant term of the 3 x 3 normal equations.
    m00, m01, m02 = s2 * s4 - s3 * s3, s1 * s4 - s2 * s3, s1 * s3 - s2 * s2
    determinant = s0 * m00 - s1 * m01 + s2 * m02
    regular = determinant > 1e-12 * s0**3
    mean = np.divide(b0, s0, out=y.copy(), where=s0 > 0)
    return np.divide(b0 * m00 - b1 * m01 + b2 * m02, determinant, out=mean, where=regular)


@kernel
def _moments(weight: Array, weighted: Array, kernels: Array) -> Array:
    """(8, N): sums of w d^p, p = 0..4, and of w y d^p, p = 0..2, over the window of each sample."""
    half = kernels.shape[1] - 1
    samples = weight.size - 2 * half
    sums = np.empty((8, samples))
    for start in range(0, samples, BLOCK):
        stop = min(start + BLOCK, samples)
        for k in range(start, stop):
            sums[0, k] = weight[half + k]
            sums[5, k] = weighted[half + k]
            sums[1, k] = sums[2, k] = sums[3, k] = sums[4, k] = sums[6, k] = sums[7, k] = 0.0
        for j in range(1, half + 1):
            c0, c1, c2, c3, c4 = kernels[0, j], kernels[1, j], kernels[2, j], kernels[3, j], kernels[4, j]
            for k in range(start, stop):
                # Samples j ahead and j behind: their odd powers differ in sign only.
                even = weight[half + k + j] + weight[half + k - j]
                odd = weight[half + k + j] - weight[half + k - j]
                sums[0, k] += c0 * even
                sums[1, k] += c1 * odd
                sums[2, k] += c2 * even
                sums[3, k] += c3 * odd
                sums[4, k] += c4 * even
                even = weighted[half + k + j] + weighted[half + k - j]
                odd = weighted[half + k + j] - weighted[half + k - j]
                sums[5, k] += c0 * even
                sums[6, k] += c1 * odd
                sums[7, k] += c2 * even
    return sums
