"""A finite sum of harmonic sines: q(t) = q0 + sum_k A_k sin(k w t), w = 2 pi f.

Position and acceleration of a sine are zero where it starts and where its period ends, so q = q0 and
ddq = 0 there with any amplitudes; sum_k k A_k = 0 makes the velocity vanish too and costs one of them.
The second half of the motion is the first, run backward and mirrored at q0.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from .linear import HarmonicTrajectory, LinearBasis

Array = NDArray[np.float64]


@dataclass(frozen=True)
class HarmonicSines(HarmonicTrajectory):
    """A periodic motion of n joints with N sines; implements ``Trajectory``.

    base_frequency: Hz. centre: (n,) rad (m), where it starts and its mean. amplitude: (n, N) rad (m).
    """

    kind: ClassVar[str] = "harmonic_sines"
    centre: Array
    amplitude: Array

    def columns(self, time: Array) -> tuple[Array, Array, Array]:
        """Each (N, m): the factors of the amplitudes in q - centre, dq and ddq at the times (N,) s."""
        return _sines(self.base_frequency, self.harmonics, time)

    def rest_conditions(self) -> dict[str, tuple[Array, float, str]]:
        """Sums (n,) that vanish in a motion that starts at rest, by amplitude."""
        order = np.arange(1, self.harmonics + 1)
        size = float(np.abs(self.amplitude * order).max())
        return {"amplitude": (self.amplitude @ order, size, "sum k A_k = 0")}


@dataclass(frozen=True)
class HarmonicSinesBasis(LinearBasis):
    """The free coefficients of harmonic sines: the centre and N - 1 for a motion at rest at its ends.

    base_frequency: Hz. harmonics: N >= 2.
    """

    fewest: ClassVar[int] = 2
    why: ClassVar[str] = ", to start and end at rest"

    @cached_property
    def combinations(self) -> Array:
        """(N, N - 1): amplitudes of each free coefficient."""
        return self._null_space / _angular_frequencies(self.base_frequency, self.harmonics)[:, None]

    def columns(self, time: Array) -> tuple[Array, Array, Array]:
        """Each (N, N): the factors of the amplitudes in q - centre, dq and ddq at the times (N,) s."""
        return _sines(self.base_frequency, self.harmonics, time)

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
