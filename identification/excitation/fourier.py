"""Fourier series in the joint coordinates, at rest where they start and end.

Swevers, Ganseman, Tükel, De Schutter & Van Brussel (1997), "Optimal robot excitation and
identification": with w = 2 pi f,

    q(t) = q0 + sum_k a_k / (w k) sin(w k t) - b_k / (w k) cos(w k t).

Sum a_k = 0 and sum k b_k = 0 make velocity and acceleration vanish at t = 0 and after every period.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .columns import with_constant
from .fields import numbers, positive, rows

Array = NDArray[np.float64]

# Rest conditions hold to rounding in a designed series; a file may have been rounded by a writer.
REST_TOLERANCE = 1e-6


@dataclass(frozen=True)
class FourierSeries:
    """A periodic motion of n joints with N harmonics; implements ``Trajectory``.

    base_frequency: Hz. centre: (n,) rad (m), the mean position. a, b: (n, N) rad/s (m/s), velocity
    amplitudes of the cosines and sines.
    """

    base_frequency: float
    centre: Array
    a: Array
    b: Array

    @property
    def duration(self) -> float:
        """The period, s."""
        return 1.0 / self.base_frequency

    @property
    def joints(self) -> int:
        """Number of joints."""
        return len(self.centre)

    @property
    def harmonics(self) -> int:
        """Number of harmonics, N."""
        return self.a.shape[1]

    @property
    def highest_frequency(self) -> float:
        """Frequency of the last harmonic, Hz."""
        return self.base_frequency * self.harmonics

    def evaluate(self, time: Array) -> tuple[Array, Array, Array]:
        """q, dq, ddq at the times (N,) s: each (N, n), rad, rad/s, rad/s²."""
        position, velocity, acceleration = _harmonics(self.base_frequency, self.harmonics, time)
        coefficients = np.hstack([self.a, self.b]).T
        return self.centre + position @ coefficients, velocity @ coefficients, acceleration @ coefficients

    def scaled(self, factor: float | Array) -> "FourierSeries":
        """The motion with its amplitudes about the centre multiplied by a number or by (n,) numbers."""
        rows = np.broadcast_to(factor, (self.joints,))[:, None]
        return FourierSeries(self.base_frequency, self.centre, rows * self.a, rows * self.b)

    def to_dict(self) -> dict[str, Any]:
        """JSON-able, keys spelled out, SI units."""
        return {
            "type": "fourier",
            "base_frequency": self.base_frequency,
            "centre": self.centre.tolist(),
            "a": self.a.tolist(),
            "b": self.b.tolist(),
        }

    @staticmethod
    def from_dict(data: dict[str, Any]) -> "FourierSeries":
        """The inverse of ``to_dict``. Raises InputError for missing, misshapen or moving-start values."""
        frequency, centre = positive(data, "base_frequency", "Hz"), numbers(data, "centre", 1)
        a = rows(data, "a", (len(centre), numbers(data, "a", 2).shape[1]))
        b = rows(data, "b", a.shape)
        order = np.arange(1, a.shape[1] + 1)
        size = max(float(np.abs(a).max()), float((order * np.abs(b)).max()))
        for name, rest in (("a", a.sum(axis=1)), ("b", b @ order)):
            if np.abs(rest).max() > REST_TOLERANCE * size:
                expected = "a start at rest: sum a_k = 0 and sum k b_k = 0 for every joint"
                raise InputError("trajectory", name, expected, f"sums {rest.tolist()}")
        return FourierSeries(frequency, centre, a, b)


@dataclass(frozen=True)
class FourierBasis:
    """The free coefficients of a Fourier series: the centre and 2N - 2 for a motion at rest at its ends.

    base_frequency: Hz. harmonics: N >= 2. The columns of ``null_space`` (2N, 2N - 2) are orthonormal
    and span the coefficients (a, b) that meet the end conditions.
    """

    base_frequency: float
    harmonics: int

    def __post_init__(self) -> None:
        if self.harmonics < 2:
            raise InputError(
                "excitation", "harmonics", "at least 2, to start and end at rest", self.harmonics
            )
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
        """Free coefficients a joint, the centre first: 2N - 1."""
        return 2 * self.harmonics - 1

    @property
    def null_space(self) -> Array:
        """(2N, 2N - 2) orthonormal basis of the coefficients (a, b) with sum a_k = sum k b_k = 0."""
        conditions = np.zeros((2 * self.harmonics, 2))
        conditions[: self.harmonics, 0] = 1.0
        conditions[self.harmonics :, 1] = np.arange(1, self.harmonics + 1)
        return np.linalg.qr(conditions, mode="complete")[0][:, 2:]

    def matrices(self, time: Array) -> tuple[Array, Array, Array]:
        """Each (N, size): q, dq and ddq of a joint at the times (N,) are these times its coefficients."""
        null_space = self.null_space
        parts = _harmonics(self.base_frequency, self.harmonics, time)
        return with_constant(*(part @ null_space for part in parts))

    def trajectory(self, coefficients: Array) -> FourierSeries:
        """The series of free coefficients (size, n): centre rad (m), the others rad/s (m/s)."""
        full = (self.null_space @ coefficients[1:]).T
        a, b = full[:, : self.harmonics], full[:, self.harmonics :]
        return FourierSeries(self.base_frequency, coefficients[0].copy(), a.copy(), b.copy())

    def free_coefficients(self, series: FourierSeries) -> Array:
        """(size, n), the inverse of ``trajectory``."""
        return np.vstack([series.centre, self.null_space.T @ np.hstack([series.a, series.b]).T])


def _harmonics(base_frequency: float, harmonics: int, time: Array) -> tuple[Array, Array, Array]:
    """Each (N, 2 harmonics): the factors of (a, b) in q - q0, dq and ddq at the times (N,)."""
    omega = 2 * np.pi * base_frequency * np.arange(1, harmonics + 1)
    phase = np.outer(time, omega)
    sine, cosine = np.sin(phase), np.cos(phase)
    return (
        np.hstack([sine / omega, -cosine / omega]),
        np.hstack([cosine, sine]),
        np.hstack([-sine * omega, cosine * omega]),
    )
