"""Causal observer of a constant-acceleration motion: usable online, at the price of lag.

A Luenberger observer of [q, dq, ddq] with its three poles at one place, -w (the high-gain observer
of Khalil 2017, "High-Gain Observers in Nonlinear Feedback Control"), in the exact discrete form of the
critically damped g-h-k filter (Brookner 1998, "Tracking and Kalman Filtering Made Easy", section 1.3):
with p = exp(-w / rate) the corrections are

    q: 1 - p³        dq: 3/2 (1 - p)² (1 + p) rate        ddq: (1 - p)³ rate².

The acceleration is the true one through w³ / (s + w)³: it lags by 3 / w. The torque is not delayed
with it, which is what such an observer costs an identification.
"""

import numpy as np

from ..filtering import edge_samples, require_cutoff
from ..integrator_chain import follow, initial_state, transition
from ..signals import Motion, Signals

ORDER = 3


def differentiate(motion: Motion, cutoff: float) -> Signals:
    """Observed position, velocity and acceleration; half the acceleration is left at ``cutoff`` Hz."""
    rate = motion.sample_rate
    require_cutoff(cutoff, rate, len(motion.position))
    pole = np.exp(-pole_speed(cutoff) / rate)
    gain = np.array([1 - pole**3, 1.5 * (1 - pole) ** 2 * (1 + pole) * rate, (1 - pole) ** 3 * rate**2])
    position = np.ascontiguousarray(motion.position)
    start = initial_state(position, ORDER, 1 / rate, max(2 * ORDER, round(rate / cutoff)))
    states = follow(position, transition(ORDER, 1 / rate), gain, start)
    q, dq, ddq = (np.ascontiguousarray(states[:, :, i]) for i in range(ORDER))
    return Signals(q, dq, ddq, motion.torque, rate, edge_samples(rate, cutoff))


def pole_speed(cutoff: float) -> float:
    """w, rad/s, at which w³ / (s + w)³ leaves half the amplitude at ``cutoff`` Hz."""
    return 2 * np.pi * cutoff / np.sqrt(2 ** (2 / 3) - 1)
