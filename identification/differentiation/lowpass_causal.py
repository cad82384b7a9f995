"""One forward pass of a Butterworth low-pass, then central differences: the plain way, with its lag.

The position, and with it velocity and acceleration, come late by the filter's delay (2.6 / (2 pi cutoff)
for slow motion); the torque does not, and that mismatch biases what is identified. Kept as the baseline
against which zero-phase methods are measured.
"""

from scipy import signal

from ..filtering import ORDER, central_difference, edge_samples, require_cutoff
from ..signals import Motion, Signals


def differentiate(motion: Motion, cutoff: float) -> Signals:
    """Position low-passed once, 3 dB at ``cutoff`` Hz; velocity and acceleration by central differences."""
    require_cutoff(cutoff, motion.sample_rate, len(motion.position))
    sections = signal.butter(ORDER, cutoff, fs=motion.sample_rate, output="sos")
    # As if the joint had stood at its first position before.
    start = signal.sosfilt_zi(sections)[:, :, None] * motion.position[0]
    q, _ = signal.sosfilt(sections, motion.position, axis=0, zi=start)
    dq = central_difference(q, motion.sample_rate)
    ddq = central_difference(dq, motion.sample_rate)
    trim = edge_samples(motion.sample_rate, cutoff)
    return Signals(q, dq, ddq, motion.torque, motion.sample_rate, trim)
