"""The band of each joint in which its torque can be compared: as wide as its encoders' noise leaves it.

Acceleration from a noisy position, times inertia, is a torque that nobody applied: its density rises with the
fourth power of the frequency. Where it is let in, effects that act like smoothing (a delay, an elasticity)
seem to take it away again.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import signal

from .chain import Chain
from .inverse_dynamics import mass_matrices
from .signals import Motion

Array = NDArray[np.float64]

# Share of a joint's RMS torque that its encoders may seem to add: half a healthy drive's own noise.
NOISE = 0.0025
# Hz: elasticity and backlash show in motion of up to 6 Hz.
LOWEST = 8.0
# Differences of this order leave nothing of the motion in the part of the spectrum where noise is read.
ORDER, QUIET, SEGMENT, FEWEST = 4, (0.25, 0.45), 256, 40
# Poses that the inertia is averaged over.
POSES = 40


@dataclass(frozen=True)
class Bands:
    """Each joint's cut-off, (n,) Hz, and the RMS torque, (n,) N·m, that encoders seem to add below it."""

    cutoff: Array
    encoder_torque: Array


def joint_bands(chain: Chain, parameters: Array, motions: Sequence[Motion], widest: float) -> Bands:
    """Cut-offs, at most ``widest`` Hz, below which encoders leave each joint's torque known to NOISE.

    parameters: (14 n,) standard parameters, of which the inertia counts. White position noise of density S
    through an inertia matrix M has a torque's mean square of (2 pi)^4 f^5 / 5 sum_k M_jk^2 S_k
    below f.
    """
    density = np.max([position_noise(each) for each in motions], axis=0)
    positions = np.concatenate([each.position for each in motions])
    poses = positions[:: max(len(positions) // POSES, 1)]
    matrices = mass_matrices(chain, parameters, poses, threads=1)
    squared = np.mean(matrices**2, axis=0) @ density
    torque = np.sqrt(np.mean(np.concatenate([each.torque for each in motions]) ** 2, axis=0))
    fifth = (2 * np.pi) ** 4 / 5 * np.maximum(squared, 1e-300)
    cutoff = np.clip(((NOISE * torque) ** 2 / fifth) ** 0.2, min(LOWEST, widest), widest)
    return Bands(cutoff, np.sqrt(fifth * cutoff**5))


def position_noise(motion: Motion) -> Array:
    """One-sided density (n,) rad²/Hz of the position's noise, taken to be white, from its fast part.

    None is seen in a run of fewer than FEWEST samples.
    """
    rate = motion.sample_rate
    if len(motion.position) < FEWEST:
        return np.zeros(motion.position.shape[1])
    differences = np.diff(motion.position, ORDER, axis=0)
    length = min(SEGMENT, len(differences))
    frequency, density = signal.welch(differences, rate, nperseg=length, axis=0, average="median")
    quiet = (frequency >= QUIET[0] * rate) & (frequency <= QUIET[1] * rate)
    gain = (2 * np.sin(np.pi * frequency[quiet] / rate)) ** (2 * ORDER)
    return np.median(density[quiet] / gain[:, None], axis=0)
