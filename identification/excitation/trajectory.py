"""What a trajectory is: positions, velocities and accelerations at any time, in closed form."""

from typing import Any, Protocol, Self, TypeVar

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

    @property
    def highest_frequency(self) -> float:
        """Hz of its fastest content, which says how finely it must be checked."""
        ...

    def evaluate(self, time: Array) -> tuple[Array, Array, Array]:
        """q, dq, ddq at the times (N,): each (N, n), rad, rad/s, rad/s²."""
        ...

    def scaled(self, factor: float | Array) -> Self:
        """The motion with its amplitudes about the centre multiplied by a number or by (n,) numbers."""
        ...

    def to_dict(self) -> dict[str, Any]:
        """JSON-able, with its ``type``; SI units."""
        ...


T = TypeVar("T", bound=Trajectory)


class TrajectoryBasis(Protocol[T]):
    """A family of trajectories that are linear in their free coefficients (size, n), the centre first."""

    @property
    def duration(self) -> float:
        """Seconds until the motion repeats."""
        ...

    @property
    def highest_frequency(self) -> float:
        """Hz of the fastest content."""
        ...

    @property
    def size(self) -> int:
        """Free coefficients a joint."""
        ...

    def matrices(self, time: Array) -> tuple[Array, Array, Array]:
        """Each (N, size): q, dq and ddq of a joint at the times (N,) are these times its coefficients."""
        ...

    def trajectory(self, coefficients: Array) -> T:
        """The motion of free coefficients (size, n): centre rad (m), the others rad/s (m/s)."""
        ...

    def free_coefficients(self, trajectory: T) -> Array:
        """(size, n), the inverse of ``trajectory``."""
        ...
