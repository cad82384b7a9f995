"""Zero-phase Butterworth low-pass on the position, then central differences.

Gautier & Khalil's usual practice (e.g. Janot, Vandanjon & Gautier 2014, section III).
"""

from ..filtering import central_difference, edge_samples, require_cutoff, zero_phase_lowpass
from ..signals import Motion, Signals


def differentiate(motion: Motion, cutoff: float) -> Signals:
    """Position low-passed at ``cutoff`` Hz, velocity and acceleration by central differences."""
    require_cutoff(cutoff, motion.sample_rate, len(motion.position))
    q = zero_phase_lowpass(motion.position, motion.sample_rate, cutoff)
    dq = central_difference(q, motion.sample_rate)
    ddq = central_difference(dq, motion.sample_rate)
    trim = edge_samples(motion.sample_rate, cutoff)
    return Signals(q, dq, ddq, motion.torque, motion.sample_rate, trim)
