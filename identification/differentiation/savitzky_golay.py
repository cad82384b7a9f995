"""Savitzky-Golay: the derivatives of a quartic fitted by least squares around each sample.

Savitzky & Golay (1964); Schafer (2011), "What is a Savitzky-Golay filter?". Zero phase; exact on
polynomials up to degree 4, at the ends too. Its stop band leaks: the gain falls off slowly in lobes.
"""

from scipy.signal import savgol_filter

from ..filtering import require_cutoff
from ..signals import Motion, Signals

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
        savgol_filter(motion.position, 2 * half + 1, DEGREE, deriv=order, delta=1 / rate, axis=0)
        for order in range(3)
    )
    return Signals(q, dq, ddq, motion.torque, rate, half)
