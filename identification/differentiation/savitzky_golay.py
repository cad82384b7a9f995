"""Savitzky-Golay: the derivatives of a quartic fitted by least squares around each sample.

Savitzky & Golay (1964); Schafer (2011), "What is a Savitzky-Golay filter?". Zero phase; exact on
polynomials up to degree 4, at the ends too. Its stop band leaks: the gain falls off slowly in lobes.
"""

import numpy as np
from numpy.polynomial import legendre
from scipy.ndimage import correlate1d

from ..filtering import require_cutoff
from ..signals import Array, Motion, Signals

DEGREE = 4
# Cut-off periods in the window when the position at the cut-off keeps half its amplitude.
WINDOW_PERIODS = 1.936


def differentiate(motion: Motion, cutoff: float) -> Signals:
    """Derivatives of the local quartic; half the position's amplitude is left at ``cutoff`` Hz."""
    rate = motion.sample_rate
    require_cutoff(cutoff, rate, len(motion.position))
    # Five points would be interpolated, not smoothed.
    half = max(DEGREE // 2 + 1, round((WINDOW_PERIODS * rate / cutoff - 1) / 2))
    q, dq, ddq = (
        _derivative(motion.position, weights * (rate / half) ** order)
        for order, weights in enumerate(_weights(half))
    )
    return Signals(q, dq, ddq, motion.torque, rate, half)


def _weights(half: int) -> list[Array]:
    """Value, slope and curvature of the quartic at each of 2 half + 1 samples (rows) by the positions there.

    The window is one from -1 to 1 and its basis Legendre's: powers of the sample number, which
    scipy.signal.savgol_filter has, leave six digits less of the curvature.
    """
    window = np.linspace(-1.0, 1.0, 2 * half + 1)
    fit = np.linalg.pinv(legendre.legvander(window, DEGREE))
    basis = np.eye(DEGREE + 1)
    return [legendre.legval(window, legendre.legder(basis, order)).T @ fit for order in range(3)]


def _derivative(position: Array, weights: Array) -> Array:
    """Positions (samples, joints) by the row in the middle; at the ends by those of the outermost windows."""
    window, half = len(weights), len(weights) // 2
    out = correlate1d(position, weights[half], axis=0)
    out[:half] = weights[:half] @ position[:window]
    out[-half:] = weights[-half:] @ position[-window:]
    return out
