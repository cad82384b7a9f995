"""Fifth-order polynomials from via point to via point, and back to the first.

Between two via points the quintic that takes their positions, velocities and accelerations is unique,
so position, velocity and acceleration are continuous; at the first point, which is also the last, the
arm rests. Via points at rest give q = q0 + (qf - q0)(10 s³ - 15 s⁴ + 6 s⁵). Positions, velocities and
accelerations of the via points as free coefficients: Gautier & Khalil (1992), "Exciting trajectories
for the identification of base inertial parameters of robots".
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .columns import orthonormal_combinations
from .fields import numbers, positive, rows
from .linear import LinearBasis, LinearTrajectory

Array = NDArray[np.float64]

# Instants a segment at which the free coefficients are made orthogonal.
SAMPLES_PER_SEGMENT = 32
# Rows: powers of s from 0 to 5. Columns: the polynomials that take position, velocity and acceleration
# at s = 0, then at s = 1.
HERMITE = np.array(
    [
        [1.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        [0.0, 1.0, 0.0, 0.0, 0.0, 0.0],
        [0.0, 0.0, 0.5, 0.0, 0.0, 0.0],
        [-10.0, -6.0, -1.5, 10.0, -4.0, 0.5],
        [15.0, 8.0, 1.5, -15.0, 7.0, -1.0],
        [-6.0, -3.0, -0.5, 6.0, -3.0, 0.5],
    ]
)


@dataclass(frozen=True)
class QuinticPath(LinearTrajectory):
    """A closed motion of n joints through M equally timed via points; implements ``Trajectory``.

    duration: s, of all M segments. position, velocity, acceleration: (M, n) rad, rad/s, rad/s² (m,
    m/s, m/s²) at the start of each segment; zero velocity and acceleration in the first row.
    """

    kind: ClassVar[str] = "quintic"
    duration: float
    position: Array
    velocity: Array
    acceleration: Array

    @property
    def place(self) -> Array:
        """(n,) rad (m), the start."""
        return self.position[0]

    @property
    def coefficients(self) -> Array:
        """(3M, n): positions from the start on, velocities, accelerations."""
        # About the start, so that a joint that does not move stands still to the last bit.
        return np.vstack([self.position - self.place, self.velocity, self.acceleration])

    @property
    def highest_frequency(self) -> float:
        """One cycle of acceleration a segment, Hz."""
        return len(self.position) / self.duration

    def columns(self, time: Array) -> tuple[Array, Array, Array]:
        """Each (N, 3M): the factors of the coefficients in q - place, dq and ddq at the times (N,) s."""
        return _columns(self.duration, len(self.position), time)

    def scaled(self, factor: float | Array) -> "QuinticPath":
        """The motion with its way from the start multiplied by a number or by (n,) numbers."""
        start = self.position[0]
        return QuinticPath(
            self.duration,
            start + factor * (self.position - start),
            factor * self.velocity,
            factor * self.acceleration,
        )

    @classmethod
    def from_dict(cls, data: dict[str, Any]) -> Self:
        """The inverse of ``to_dict``. Raises InputError for missing, misshapen or moving-start values."""
        duration, position = positive(data, "duration", "s"), numbers(data, "position", 2)
        shape = (len(position), position.shape[1])
        points = [rows(data, key, shape) for key in ("position", "velocity", "acceleration")]
        for key, values in zip(("velocity", "acceleration"), points[1:], strict=True):
            if np.any(values[0] != 0):
                raise InputError("trajectory", key, "zeros in the first row", values[0].tolist())
        return cls(duration, *points)


@dataclass(frozen=True)
class QuinticBasis(LinearBasis):
    """The free coefficients of a quintic path: the start and 3 for every other via point.

    base_frequency: Hz, of the whole closed path. harmonics: its segments, M >= 2.
    """

    fewest: ClassVar[int] = 2
    why: ClassVar[str] = " segments, to come back"

    @cached_property
    def combinations(self) -> Array:
        """(3M - 3, 3M - 3): position, velocity and acceleration of the via points, of each coefficient."""
        count = SAMPLES_PER_SEGMENT * self.harmonics
        return orthonormal_combinations(self.columns(np.arange(count) * self.duration / count)[1])

    def columns(self, time: Array) -> tuple[Array, Array, Array]:
        """Each (N, 3M - 3): the factors of all via points but the first, in q - start, dq and ddq."""
        every = np.arange(3 * self.harmonics)
        moving = every[every % self.harmonics > 0]
        position, velocity, acceleration = _columns(self.duration, self.harmonics, time)
        return position[:, moving], velocity[:, moving], acceleration[:, moving]

    def trajectory(self, coefficients: Array) -> QuinticPath:
        """The path of free coefficients (size, n): start rad (m), the others rad/s (m/s)."""
        moving = (self.combinations @ coefficients[1:]).reshape(3, self.harmonics - 1, -1)
        position, velocity, acceleration = (np.pad(part, ((1, 0), (0, 0))) for part in moving)
        return QuinticPath(self.duration, coefficients[0] + position, velocity, acceleration)

    def free_coefficients(self, path: QuinticPath) -> Array:
        """(size, n), the inverse of ``trajectory``."""
        start = path.position[0]
        moving = np.vstack([path.position[1:] - start, path.velocity[1:], path.acceleration[1:]])
        return np.vstack([start, np.linalg.solve(self.combinations, moving)])


def _columns(duration: float, segments: int, time: Array) -> tuple[Array, Array, Array]:
    """Each (N, 3M): the factors of the M positions, M velocities and M accelerations in q, dq and ddq."""
    step = duration / segments
    progress = np.mod(time, duration) / step
    segment = np.minimum(progress.astype(np.int64), segments - 1)
    s = progress - segment
    # Velocities and accelerations at the ends, in units of the segment's time.
    units = np.tile(step ** np.arange(3.0), 2)
    power = np.arange(6)
    index = np.arange(3) * segments
    columns = np.hstack([segment[:, None] + index, (segment + 1)[:, None] % segments + index])
    parts = []
    for order in range(3):
        # The factor and exponent that each power of s has after ``order`` derivatives.
        factor = np.prod([power - i for i in range(order)], axis=0)
        powers = factor * s[:, None] ** np.maximum(power - order, 0)
        part = np.zeros((len(time), 3 * segments))
        part[np.arange(len(time))[:, None], columns] = powers @ HERMITE * units / step**order
        parts.append(part)
    return parts[0], parts[1], parts[2]
