"""Modified Fourier series: a Fourier series and a fifth-order polynomial that meets the end conditions.

Every coefficient stays free; the six coefficients of the polynomial follow from q = start, dq = 0 and
ddq = 0 at t = 0 and t = T (Park 2006, "Fourier-based optimal excitation trajectories for the dynamic
identification of robots"). With w = 2 pi / T and s = t / T it is

    q(t) = start + sum_k a_k [sin(w k t) / (w k) - T v(s)] + b_k [(1 - cos(w k t)) / (w k) - w k T² u(s)],
    v(s) = s - 10 s³ + 15 s⁴ - 6 s⁵,    u(s) = (s² - 2 s³ + s⁴) / 2,

v having slope 1 and u curvature 1 at both ends, and nothing else there.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .columns import orthonormal_combinations, with_constant
from .fields import numbers, positive, rows

Array = NDArray[np.float64]

# Instants in a period of the fastest harmonic at which the free coefficients are made orthogonal.
SAMPLES_PER_PERIOD = 32


@dataclass(frozen=True)
class ModifiedFourierSeries:
    """A motion of n joints with N harmonics that starts and ends at ``start``; implements ``Trajectory``.

    base_frequency: Hz. start: (n,) rad (m). a, b: (n, N) rad/s (m/s), velocity amplitudes of the
    cosines and sines.
    """

    base_frequency: float
    start: Array
    a: Array
    b: Array

    @property
    def duration(self) -> float:
        """The period, s."""
        return 1.0 / self.base_frequency

    @property
    def joints(self) -> int:
        """Number of joints."""
        return len(self.start)

    @property
    def highest_frequency(self) -> float:
        """Frequency of the last harmonic, Hz."""
        return self.base_frequency * self.a.shape[1]

    def evaluate(self, time: Array) -> tuple[Array, Array, Array]:
        """q, dq, ddq at the times (N,) s: each (N, n), rad, rad/s, rad/s²."""
        position, velocity, acceleration = _columns(self.base_frequency, self.a.shape[1], time)
        coefficients = np.hstack([self.a, self.b]).T
        return self.start + position @ coefficients, velocity @ coefficients, acceleration @ coefficients

    def scaled(self, factor: float | Array) -> "ModifiedFourierSeries":
        """The motion with its way from the start multiplied by a number or by (n,) numbers."""
        row = np.broadcast_to(factor, (self.joints,))[:, None]
        return ModifiedFourierSeries(self.base_frequency, self.start, row * self.a, row * self.b)

    def to_dict(self) -> dict[str, Any]:
        """JSON-able, keys spelled out, SI units."""
        return {
            "type": "modified_fourier",
            "base_frequency": self.base_frequency,
            "start": self.start.tolist(),
            "a": self.a.tolist(),
            "b": self.b.tolist(),
        }

    @staticmethod
    def from_dict(data: dict[str, Any]) -> "ModifiedFourierSeries":
        """The inverse of ``to_dict``. Raises InputError for missing or misshapen values."""
        frequency, start = positive(data, "base_frequency", "Hz"), numbers(data, "start", 1)
        shape = (len(start), numbers(data, "a", 2).shape[1])
        return ModifiedFourierSeries(frequency, start, rows(data, "a", shape), rows(data, "b", shape))


@dataclass(frozen=True)
class ModifiedFourierBasis:
    """The free coefficients of a modified Fourier series: the start and 2N more a joint.

    base_frequency: Hz. harmonics: N >= 1. The coefficients are combinations of (a, b) whose velocities
    are orthogonal.
    """

    base_frequency: float
    harmonics: int

    def __post_init__(self) -> None:
        if self.harmonics < 1:
            raise InputError("excitation", "harmonics", "at least 1", self.harmonics)
        if not 0 < self.base_frequency < np.inf:
            raise InputError("excitation", "base_frequency", "a positive number of Hz", self.base_frequency)

    @property
    def duration(self) -> float:
        """The period, s."""
        return 1.0 / self.base_frequency

    @property
    def highest_frequency(self) -> float:
        """Frequency of the last harmonic, Hz."""
        return self.base_frequency * self.harmonics

    @property
    def size(self) -> int:
        """Free coefficients a joint, the start first: 2N + 1."""
        return 2 * self.harmonics + 1

    def matrices(self, time: Array) -> tuple[Array, Array, Array]:
        """Each (N, size): q, dq and ddq of a joint at the times (N,) are these times its coefficients."""
        columns = _columns(self.base_frequency, self.harmonics, time)
        return with_constant(*(part @ self._combinations for part in columns))

    def trajectory(self, coefficients: Array) -> ModifiedFourierSeries:
        """The series of free coefficients (size, n): start rad (m), the others rad/s (m/s)."""
        full = (self._combinations @ coefficients[1:]).T
        a, b = full[:, : self.harmonics], full[:, self.harmonics :]
        return ModifiedFourierSeries(self.base_frequency, coefficients[0].copy(), a.copy(), b.copy())

    def free_coefficients(self, series: ModifiedFourierSeries) -> Array:
        """(size, n), the inverse of ``trajectory``."""
        full = np.hstack([series.a, series.b]).T
        return np.vstack([series.start, np.linalg.solve(self._combinations, full)])

    @cached_property
    def _combinations(self) -> Array:
        """(2N, 2N): (a, b) of each free coefficient."""
        time = np.arange(SAMPLES_PER_PERIOD * self.harmonics) / (SAMPLES_PER_PERIOD * self.highest_frequency)
        return orthonormal_combinations(_columns(self.base_frequency, self.harmonics, time)[1])


def _columns(base_frequency: float, harmonics: int, time: Array) -> tuple[Array, Array, Array]:
    """Each (N, 2 harmonics): the factors of (a, b) in q - start, dq and ddq at the times (N,)."""
    period = 1.0 / base_frequency
    omega = 2 * np.pi * base_frequency * np.arange(1, harmonics + 1)
    s = np.mod(time, period)[:, None] / period
    phase = period * s * omega
    sine, cosine = np.sin(phase), np.cos(phase)
    slope = (
        s - 10 * s**3 + 15 * s**4 - 6 * s**5,
        1 - 30 * s**2 * (1 - s) ** 2,
        -60 * s * (1 - s) * (1 - 2 * s),
    )
    curve = (0.5 * s**2 * (1 - s) ** 2, s - 3 * s**2 + 2 * s**3, 1 - 6 * s + 6 * s**2)
    return (
        np.hstack([sine / omega - period * slope[0], (1 - cosine) / omega - omega * period**2 * curve[0]]),
        np.hstack([cosine - slope[1], sine - omega * period * curve[1]]),
        np.hstack([-omega * sine - slope[2] / period, omega * cosine - omega * curve[2]]),
    )
