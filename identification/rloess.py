"""RLOESS: robust local quadratic regression of equally spaced samples.

Cleveland (1979), "Robust locally weighted regression and smoothing scatterplots", as the source
uses it: a quadratic fitted around each sample with tricube weights (1 - |d|³)³, then five passes
in which each sample also carries a bisquare weight (1 - (r / 6 MAD)²)² of its last residual r.
MAD is the median absolute residual of the whole series. Windows are cut off at the ends.
"""

import numpy as np
from numpy.typing import NDArray

from .kinematics import kernel

Array = NDArray[np.float64]

ROBUST_PASSES = 5
# Six median absolute deviations: residuals beyond count nothing.
CUTOFF_IN_MAD = 6.0


def rloess(x: Array, window: int) -> Array:
    """Smooth each column of x (N, n) over ``window`` samples (odd; the next odd number when even).

    Returns (N, n). A window of N or more is cut to the series; below 5 samples x is returned.
    """
    half = min(window, len(x)) // 2
    if half < 2:
        return x.copy()
    distance = np.arange(-half, half + 1) / (half + 1)
    tricube = (1 - np.abs(distance) ** 3) ** 3
    out = np.empty_like(x)
    for column in range(x.shape[1]):
        series = np.ascontiguousarray(x[:, column])
        weights = np.ones(len(series))
        smooth = np.empty(len(series))
        _local_quadratic(series, weights, tricube, smooth)
        for _ in range(ROBUST_PASSES):
            residual = np.abs(series - smooth)
            scale = CUTOFF_IN_MAD * np.median(residual)
            # A series that is already smooth to rounding has no outliers to find.
            if scale <= 1e-12 * np.max(np.abs(series), initial=0.0):
                break
            weights = np.clip(1 - (residual / scale) ** 2, 0, None) ** 2
            _local_quadratic(series, weights, tricube, smooth)
        out[:, column] = smooth
    return out


@kernel
def _local_quadratic(y, robust, tricube, out):  # type: ignore[no-untyped-def]
    """out[k]: value at k of the weighted quadratic through the samples around it."""
    half = tricube.size // 2
    scale = 1.0 / half
    for k in range(y.size):
        s0 = s1 = s2 = s3 = s4 = b0 = b1 = b2 = 0.0
        for m in range(max(0, k - half), min(y.size, k + half + 1)):
            d = (m - k) * scale
            w = tricube[m - k + half] * robust[m]
            wd = w * d
            wdd = wd * d
            s0 += w
            s1 += wd
            s2 += wdd
            s3 += wdd * d
            s4 += wdd * d * d
            b0 += w * y[m]
            b1 += wd * y[m]
            b2 += wdd * y[m]
        # Cramer's rule for the constant term of the 3 x 3 normal equations.
        m00 = s2 * s4 - s3 * s3
        m01 = s1 * s4 - s2 * s3
        m02 = s1 * s3 - s2 * s2
        determinant = s0 * m00 - s1 * m01 + s2 * m02
        if determinant > 1e-12 * s0 * s0 * s0:
            out[k] = (b0 * m00 - b1 * m01 + b2 * m02) / determinant
        elif s0 > 0.0:
            out[k] = b0 / s0
        else:
            out[k] = y[k]
