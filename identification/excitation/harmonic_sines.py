"""A finite sum of harmonic sines: q(t) = q0 + sum_k A_k sin(k w t), w = 2 pi f.

Position and acceleration of a sine are zero where it starts and where its period ends, so q = q0 and
ddq = 0 there with any amplitudes; sum_k k A_k = 0 makes the velocity vanish too and costs one of them.
The second half of the motion is the first, run backward and mirrored at q0.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .columns import with_constant
from .fields import numbers, positive, rows

Array = NDArray[np.float64]

# The end condition holds to rounding in a designed motion; a file may have been rounded by a writer.
REST_TOLERANCE = 1e-6


@dataclass(frozen=True)
class HarmonicSines:
    """A periodic motion of n joints with N sines; implements ``Trajectory``.

    base_frequency: Hz. centre: (n,) rad (m), where it starts and its mean. amplitude: (n, N) rad (m).
    """

    base_frequency: float
    centre: Array
    amplitude: Array

    @property
    def duration(self) -> float:
        """The period, s."""
        return 1.0 / self.base_frequency

    @property
    def joints(self) -> int:
        """Number of joints."""
        return len(self.centre)

    @property
    def highest_frequency(self) -> float:
        """Frequency of the last sine, Hz."""
        return self.base_frequency * self.amplitude.shape[1]

    def evaluate(self, time: Array) -> tuple[Array, Array, Array]:
        """q, dq, ddq at the times (N,) s: each (N, n), rad, rad/s, rad/s²."""
        position, velocity, acceleration = _sines(self.base_frequency, self.amplitude.shape[1], time)
        amplitude = self.amplitude.T
        return self.centre + position @ amplitude, velocity @ amplitude, acceleration @ amplitude

    def scaled(self, factor: float | Array) -> "HarmonicSines":
        """The motion with its amplitudes multiplied by a number or by (n,) numbers."""
        row = np.broadcast_to(factor, (self.joints,))[:, None]
        return HarmonicSines(self.base_frequency, self.centre, row * self.amplitude)

    def to_dict(self) -> dict[str, Any]:
        """JSON-able, keys spelled out, SI units."""
        return {
            "type": "harmonic_sines",
            "base_frequency": self.base_frequency,
            "centre": self.centre.tolist(),
            "amplitude": self.amplitude.tolist(),
        }

    @staticmethod
    def from_dict(data: dict[str, Any]) -> "HarmonicSines":
        """The inverse of ``to_dict``. Raises InputError for missing, misshapen or moving-start values."""
        frequency, centre = positive(data, "base_frequency", "Hz"), numbers(data, "centre", 1)
        shape = (len(centre), numbers(data, "amplitude", 2).shape[1])
        amplitude = rows(data, "amplitude", shape)
        order = np.arange(1, shape[1] + 1)
        rest = amplitude @ order
        if np.abs(rest).max() > REST_TOLERANCE * np.abs(amplitude * order).max():
            expected = "a start at rest: sum k A_k = 0 for every joint"
            raise InputError("trajectory", "amplitude", expected, f"sums {rest.tolist()}")
        return HarmonicSines(frequency, centre, amplitude)


@dataclass(frozen=True)
class HarmonicSinesBasis:
    """The free coefficients of harmonic sines: the centre and N - 1 for a motion at rest at its ends.

    base_frequency: Hz. harmonics: N >= 2.
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
        """Frequency of the last sine, Hz."""
        return self.base_frequency * self.harmonics

    @property
    def size(self) -> int:
        """Free coefficients a joint, the centre first: N."""
        return self.harmonics

    def matrices(self, time: Array) -> tuple[Array, Array, Array]:
        """Each (N, size): q, dq and ddq of a joint at the times (N,) are these times its coefficients."""
        amplitudes = self._null_space / _angular_frequencies(self.base_frequency, self.harmonics)[:, None]
        return with_constant(
            *(part @ amplitudes for part in _sines(self.base_frequency, self.harmonics, time))
        )

    def trajectory(self, coefficients: Array) -> HarmonicSines:
        """The motion of free coefficients (size, n): centre rad (m), the others rad/s (m/s)."""
        omega = _angular_frequencies(self.base_frequency, self.harmonics)
        amplitude = (self._null_space @ coefficients[1:]).T / omega
        return HarmonicSines(self.base_frequency, coefficients[0].copy(), amplitude)

    def free_coefficients(self, sines: HarmonicSines) -> Array:
        """(size, n), the inverse of ``trajectory``."""
        omega = _angular_frequencies(self.base_frequency, self.harmonics)
        return np.vstack([sines.centre, self._null_space.T @ (sines.amplitude * omega).T])

    @property
    def _null_space(self) -> Array:
        """(N, N - 1) orthonormal basis of the velocity amplitudes w k A_k that sum to zero."""
        return np.linalg.qr(np.ones((self.harmonics, 1)), mode="complete")[0][:, 1:]


def _sines(base_frequency: float, count: int, time: Array) -> tuple[Array, Array, Array]:
    """Each (N, count): the factors of the amplitudes in q - centre, dq and ddq at the times (N,)."""
    omega = _angular_frequencies(base_frequency, count)
    phase = np.outer(time, omega)
    sine = np.sin(phase)
    return sine, omega * np.cos(phase), -(omega**2) * sine


def _angular_frequencies(base_frequency: float, count: int) -> Array:
    """(count,) rad/s."""
    return 2 * np.pi * base_frequency * np.arange(1.0, count + 1)
