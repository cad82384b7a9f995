"""Detection of the joints that move: by more than their encoders' step and noise.

A joint that is held dithers between two counts of its encoder. Differentiated, that looks like motion, and a
law of such a motion may have any coefficient.
"""

import numpy as np
from numpy.typing import NDArray

from identification.band import position_noise
from identification.signals import Motion

Array = NDArray[np.float64]

# A joint moves where it travels this many of its encoder's steps, and deviations of its noise.
TRAVEL = 20.0


def is_moving(motion: Motion, position: Array, position_step: Array) -> NDArray[np.bool_]:
    """Whether each joint (n,) travels beyond its encoder's step and noise in one run.

    motion: as logged. position: (M, n) rad (m), low-passed. position_step: (n,) rad (m), that it counts in.
    """
    noise = np.sqrt(0.5 * motion.sample_rate * position_noise(motion))
    return np.asarray(np.ptp(position, axis=0) > TRAVEL * (position_step + noise))
