"""What every identification model gives: linear equations of the base parameters, one set a run."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from .errors import InputError

Array = NDArray[np.float64]

# The position keeps twice the band of the equations, so that its own filter leaves that band flat.
POSITION_BAND = 2.0
# Highest usable cut-off as a share of the sample rate.
HIGHEST_CUTOFF = 0.4


@dataclass(frozen=True)
class Preprocessing:
    """How logged signals become equations. Raises InputError for values out of range.

    cutoff: Hz, of the parallel low-pass on torque and regressor.
    differentiation: name of the method that finds velocity and acceleration.
    dead_zone: rad/s (m/s); rows of a joint slower than this are unused.
    model: name of the identification model that writes the equations.
    joint_cutoffs: (n,) Hz, lower cut-offs of single joints' torque equations; none where empty.
    """

    cutoff: float = 20.0
    differentiation: str = "rloess"
    dead_zone: float = 0.02
    model: str = "inverse_dynamic"
    joint_cutoffs: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        if not (np.isfinite(self.cutoff) and self.cutoff > 0):
            raise InputError("identification", "cutoff", "a positive number of Hz", self.cutoff)
        if not (np.isfinite(self.dead_zone) and self.dead_zone >= 0):
            raise InputError("identification", "dead_zone", "0 or more, rad/s", self.dead_zone)

    def at(self, sample_rate: float) -> "Preprocessing":
        """The same with the cut-off lowered to what the sample rate carries."""
        return replace(self, cutoff=min(self.cutoff, HIGHEST_CUTOFF * sample_rate / POSITION_BAND))

    def cutoff_of(self, joint: int) -> float:
        """The cut-off of one joint's torque equations, Hz."""
        return min(self.cutoff, self.joint_cutoffs[joint]) if self.joint_cutoffs else self.cutoff


@dataclass(frozen=True)
class Observations:
    """The identification equations of one run: M instants of e equations each.

    e is the number of joints for the inverse dynamic model, 1 for the energy and power models.
    name: the run's. time: (M,) s from the run's start. q, dq: (M, n) filtered motion.
    regressor: (M, e, b). torque: (M, e) N·m (J or W by the energy and power models).
    used: (M, e) bool, rows that take part. sample_rate: Hz, after decimation.
    """

    name: str
    time: Array
    q: Array
    dq: Array
    regressor: Array
    torque: Array
    used: NDArray[np.bool_]
    sample_rate: float

    def residual(self, values: Array) -> Array:
        """torque - regressor @ values, (M, e)."""
        return self.torque - self.regressor @ values
