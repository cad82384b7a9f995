"""What a trajectory is: positions, velocities and accelerations at any time, in closed form."""

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Trajectory(Protocol):
    """A smooth motion that starts and ends at rest after ``duration`` seconds and repeats."""

    @property
    def duration(self) -> float:
        """Seconds until it repeats."""
        ...

    @property
    def joints(self) -> int:
        """Number of joints."""
        ...

    def evaluate(self, time: Array) -> tuple[Array, Array, Array]:
        """q, dq, ddq at the times (N,): each (N, n), rad, rad/s, rad/s²."""
        ...
