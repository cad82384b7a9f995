"""Fourier series in the joint coordinates, at rest where they start and end.

Swevers, Ganseman, Tükel, De Schutter & Van Brussel (1997), "Optimal robot excitation and
identification": with w = 2 pi f,

    q(t) = q0 + sum_k a_k / (w k) sin(w k t) - b_k / (w k) cos(w k t).

Sum a_k = 0 and sum k b_k = 0 make velocity and acceleration vanish at t = 0 and after every period.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from .linear import HarmonicTrajectory, LinearBasis

Array = NDArray[np.float64]


@dataclass(frozen=True)
class FourierSeries(HarmonicTrajectory):
    """A periodic motion of n joints with N harmonics; implements ``Trajectory``.

    base_frequency: Hz. centre: (n,) rad (m), the mean position. a, b: (n, N) rad/s (m/s), velocity
    amplitudes of the cosines and sines.
    """

    kind: ClassVar[str] = "fourier"
    centre: Array
    a: Array
    b: Array

    def columns(self, time: Array) -> tuple[Array, Array, Array]:
        """Each (N, m): the factors of (a, b) in q - centre, dq and ddq at the times (N,) s."""
        return _harmonics(self.base_frequency, self.harmonics, time)

    def rest_conditions(self) -> dict[str, tuple[Array, float, str]]:
        """Sums (n,) that vanish in a motion that starts at rest, by amplitude."""
        order = np.arange(1, self.harmonics + 1)
        size = max(float(np.abs(self.a).max()), float((order * np.abs(self.b)).max()))
        condition = "sum a_k = 0 and sum k b_k = 0"
        return {"a": (self.a.sum(axis=1), size, condition), "b": (self.b @ order, size, condition)}


@dataclass(frozen=True)
class FourierBasis(LinearBasis):
    """The free coefficients of a Fourier series: the centre and 2N - 2 for a motion at rest at its ends.

    base_frequency: Hz. harmonics: N >= 2. The columns of ``combinations`` (2N, 2N - 2) are orthonormal
    and span the coefficients (a, b) that meet the end conditions.
    """

    fewest: ClassVar[int] = 2
    why: ClassVar[str] = ", to start and end at rest"

    @cached_property
    def combinations(self) -> Array:
        """(2N, 2N - 2) orthonormal basis of the coefficients (a, b) with sum a_k = sum k b_k = 0."""
        conditions = np.zeros((2 * self.harmonics, 2))
        conditions[: self.harmonics, 0] = 1.0
        conditions[self.harmonics :, 1] = np.arange(1, self.harmonics + 1)
        return np.linalg.qr(conditions, mode="complete")[0][:, 2:]

    def columns(self, time: Array) -> tuple[Array, Array, Array]:
        """Each (N, 2N): the factors of (a, b) in q - centre, dq and ddq at the times (N,) s."""
        return _harmonics(self.base_frequency, self.harmonics, time)

    def trajectory(self, coefficients: Array) -> FourierSeries:
        """The series of free coefficients (size, n): centre rad (m), the others rad/s (m/s)."""
        full = (self.combinations @ coefficients[1:]).T
        a, b = full[:, : self.harmonics], full[:, self.harmonics :]
        return FourierSeries(self.base_frequency, coefficients[0].copy(), a.copy(), b.copy())

    def free_coefficients(self, series: FourierSeries) -> Array:
        """(size, n), the inverse of ``trajectory``."""
        return np.vstack([series.centre, self.combinations.T @ series.coefficients])


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
