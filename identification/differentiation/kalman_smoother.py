"""Kalman smoother of a constant-jerk motion: no phase lag, no differences.

The state [q, dq, ddq, jerk] of each joint is driven by white noise on the derivative of the jerk (a
Wiener-process model, Bar-Shalom, Li & Kirubarajan 2001, section 6.2), the position is measured in
white noise. Only the ratio of the two noises matters; it is set so that the smoother leaves half the
amplitude at the cut-off, where its gain is that of two Butterworth passes of order 4:

    1 / (1 + (f / cutoff)⁸)  of the position, velocity and acceleration.

The gains are those of the steady state, filtered forward and smoothed backward (Rauch, Tung &
Striebel 1965).
"""

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve, solve_discrete_are

from ..filtering import edge_samples, require_cutoff
from ..integrator_chain import follow, initial_state, process_noise, smooth_backward, transition
from ..signals import Motion, Signals

Array = NDArray[np.float64]

ORDER = 4


def differentiate(motion: Motion, cutoff: float) -> Signals:
    """Smoothed position, velocity and acceleration; half the amplitude is left at ``cutoff`` Hz."""
    rate = motion.sample_rate
    require_cutoff(cutoff, rate, len(motion.position))
    # Time in units of 1 / (2 pi cutoff) makes every matrix of order one at any rate and cut-off.
    speed = 2 * np.pi * cutoff
    step = speed / rate
    forward = transition(ORDER, step)
    gain, backward_gain = steady_state_gains(step)
    position = np.ascontiguousarray(motion.position)
    start = initial_state(position, ORDER, step, max(2 * ORDER, round(rate / cutoff)))
    states = follow(position, forward, gain, start)
    smooth_backward(states, forward, backward_gain)
    q, dq, ddq = (states[:, :, i] * speed**i for i in range(3))
    return Signals(q, dq, ddq, motion.torque, rate, edge_samples(rate, cutoff))


def steady_state_gains(step: float) -> tuple[Array, Array]:
    """Kalman gain (4,) and smoother gain (4, 4) for samples ``step`` apart, both noises of unit intensity."""
    forward = transition(ORDER, step)
    process = process_noise(ORDER, step)
    measured = np.eye(ORDER)[:, :1]
    # White noise of unit intensity, averaged over a step.
    variance = 1 / step
    predicted = solve_discrete_are(forward.T, measured, process, [[variance]])
    gain = predicted[:, 0] / (predicted[0, 0] + variance)
    filtered = predicted - np.outer(gain, predicted[0])
    return gain, solve(predicted, forward @ filtered, assume_a="pos").T
