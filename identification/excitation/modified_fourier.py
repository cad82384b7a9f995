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
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from .columns import orthonormal_combinations
from .linear import HarmonicTrajectory, LinearBasis

Array = NDArray[np.float64]

# Instants in a period of the fastest harmonic at which the free coefficients are made orthogonal.
SAMPLES_PER_PERIOD = 32


@dataclass(frozen=True)
class ModifiedFourierSeries(HarmonicTrajectory):
    """A motion of n joints with N harmonics that starts and ends at ``start``; implements ``Trajectory``.

    base_frequency: Hz. start: (n,) rad (m). a, b: (n, N) rad/s (m/s), velocity amplitudes of the
    cosines and sines.
    """

    kind: ClassVar[str] = "modified_fourier"
    start: Array
    a: Array
    b: Array

    def columns(self, time: Array) -> tuple[Array, Array, Array]:
        """Each (N, m): the factors of (a, b) in q - start, dq and ddq at the times (N,) s."""
        return _columns(self.base_frequency, self.harmonics, time)


@dataclass(frozen=True)
class ModifiedFourierBasis(LinearBasis):
    """The free coefficients of a modified Fourier series: the start and 2N more a joint.

    base_frequency: Hz. harmonics: N >= 1. The coefficients are combinations of (a, b) whose velocities
    are orthogonal.
    """

    fewest: ClassVar[int] = 1

    @cached_property
    def combinations(self) -> Array:
        """(2N, 2N): (a, b) of each free coefficient."""
        time = np.arange(SAMPLES_PER_PERIOD * self.harmonics) / (SAMPLES_PER_PERIOD * self.highest_frequency)
        return orthonormal_combinations(self.columns(time)[1])

    def columns(self, time: Array) -> tuple[Array, Array, Array]:
        """Each (N, 2N): the factors of (a, b) in q - start, dq and ddq at the times (N,) s."""
        return _columns(self.base_frequency, self.harmonics, time)

    def trajectory(self, coefficients: Array) -> ModifiedFourierSeries:
        """The series of free coefficients (size, n): start rad (m), the others rad/s (m/s)."""
        full = (self.combinations @ coefficients[1:]).T
        a, b = full[:, : self.harmonics], full[:, self.harmonics :]
        return ModifiedFourierSeries(self.base_frequency, coefficients[0].copy(), a.copy(), b.copy())

    def free_coefficients(self, series: ModifiedFourierSeries) -> Array:
        """(size, n), the inverse of ``trajectory``."""
        return np.vstack([series.start, np.linalg.solve(self.combinations, series.coefficients)])


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
