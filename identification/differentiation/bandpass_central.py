"""Zero-phase band-pass on the position, then central differences.

Read as a filter with a lower edge too: what changes more slowly than an excitation ever moves (drift of
an encoder or a mounting) is taken out of velocity and acceleration. The regressor needs the posture,
mean and trend included, so the position itself is only low-passed. In Gautier's papers "band-pass" names
the product of the zero-phase low-pass with the central difference, which is butterworth_central.

The lower edge is a zero-phase Butterworth filter too, of the run continued as its mirror image (by the
discrete cosine transform), because a recursive filter so slow would ring for longer than a run lasts.
"""

import numpy as np
from scipy.fft import dct, idct

from ..filtering import central_difference, edge_samples, require_cutoff, zero_phase_lowpass
from ..signals import Array, Motion, Signals

# Hz; a tenth of the lowest base frequency in use, that of excitation runs of 10 s.
LOWER_EDGE = 0.01
LOWER_ORDER = 2


def differentiate(motion: Motion, cutoff: float) -> Signals:
    """Position low-passed at ``cutoff`` Hz; velocity and acceleration of its part above 0.01 Hz."""
    rate = motion.sample_rate
    require_cutoff(cutoff, rate, len(motion.position))
    q = zero_phase_lowpass(motion.position, rate, cutoff)
    dq = central_difference(_zero_phase_highpass(q, rate), rate)
    ddq = central_difference(dq, rate)
    return Signals(q, dq, ddq, motion.torque, rate, edge_samples(rate, cutoff))


def _zero_phase_highpass(x: Array, rate: float) -> Array:
    """x (N, n) times 1 / (1 + (edge / f)⁴), half of it left at the lower edge."""
    frequency = np.arange(len(x)) * rate / (2 * len(x))
    power = 2 * LOWER_ORDER
    gain = frequency**power / (frequency**power + LOWER_EDGE**power)
    return idct(gain[:, None] * dct(x, axis=0), axis=0)
