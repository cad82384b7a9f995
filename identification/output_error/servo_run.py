"""A logged run of position servos, and the windows in which it is simulated."""

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ..filtering import central_difference, zero_phase_lowpass
from .servo_loop import Window

Array = NDArray[np.float64]

# s. A window starts anew from the measurement; its first moments show the error of that start.
WINDOW, SETTLING = 10.0, 0.3
# Hz, and share of the sample rate: what a measured position is smoothed to where a window starts.
SMOOTHING, SMOOTHING_SHARE = 20.0, 0.2


@dataclass(frozen=True)
class ServoRun:
    """One run on an even grid. N samples, n joints.

    position, command: (N, n) rad. rate: Hz. kp, kd: (n,) as stated for this run.
    """

    name: str
    position: Array
    command: Array
    rate: float
    kp: Array
    kd: Array

    def of(self, joints: NDArray[np.int64]) -> "ServoRun":
        """The run of some joints."""
        position, command = (np.ascontiguousarray(each[:, joints]) for each in (self.position, self.command))
        return ServoRun(self.name, position, command, self.rate, self.kp[joints], self.kd[joints])

    @cached_property
    def smoothed(self) -> tuple[Array, Array]:
        """Position and velocity (N, n), low-passed without a lag."""
        cutoff = min(SMOOTHING, SMOOTHING_SHARE * self.rate)
        position = zero_phase_lowpass(self.position, self.rate, cutoff)
        return position, central_difference(position, self.rate)


def windows(run: ServoRun, length: float = WINDOW) -> list[Window]:
    """The run in windows of about this length, s."""
    samples = len(run.position)
    count = max(1, round(samples / (length * run.rate)))
    edges = np.linspace(0, samples, count + 1).astype(int)
    position, velocity = run.smoothed
    return [
        Window(run.command, run.kp, run.kd, int(start), int(stop), position[start], velocity[start])
        for start, stop in pairwise(edges)
    ]


def counted(window: Window, rate: float) -> slice:
    """The samples of a window, from its start, after the settling."""
    return slice(min(round(SETTLING * rate), (window.stop - window.start) // 2), None)
