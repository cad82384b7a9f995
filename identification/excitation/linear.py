"""Motions that are linear in their coefficients: what all kinds of trajectory share.

At any time q is a place plus columns of that time, times coefficients; dq and ddq are the columns'
derivatives, times the same.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass, fields, replace
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .columns import with_constant
from .fields import numbers, positive, rows

Array = NDArray[np.float64]

# Rest conditions hold to rounding in a designed motion; a file may have been rounded by a writer.
REST_TOLERANCE = 1e-6


@dataclass(frozen=True)
class LinearTrajectory(ABC):
    """A motion of n joints with m coefficients each; its fields are numbers and arrays.

    kind: its ``type`` in a file.
    """

    kind: ClassVar[str]

    @property
    @abstractmethod
    def place(self) -> Array:
        """(n,) rad (m), what the motion is added to."""

    @property
    @abstractmethod
    def coefficients(self) -> Array:
        """(m, n), what the columns are multiplied by."""

    @abstractmethod
    def columns(self, time: Array) -> tuple[Array, Array, Array]:
        """Each (N, m): the factors of the coefficients in q - place, dq and ddq at the times (N,) s."""

    @property
    def joints(self) -> int:
        """Number of joints."""
        return len(self.place)

    def evaluate(self, time: Array) -> tuple[Array, Array, Array]:
        """q, dq, ddq at the times (N,) s: each (N, n), rad, rad/s, rad/s²."""
        position, velocity, acceleration = self.columns(time)
        coefficients = self.coefficients
        return self.place + position @ coefficients, velocity @ coefficients, acceleration @ coefficients

    def to_dict(self) -> dict[str, Any]:
        """JSON-able, keys spelled out, SI units."""
        values = {each.name: getattr(self, each.name) for each in fields(self)}
        plain = {key: value.tolist() if np.ndim(value) else value for key, value in values.items()}
        return {"type": self.kind, **plain}


@dataclass(frozen=True)
class HarmonicTrajectory(LinearTrajectory):
    """A periodic motion with N harmonics. The fields of a kind: base frequency, place, amplitudes (n, N).

    base_frequency: Hz.
    """

    base_frequency: float

    @property
    def place(self) -> Array:
        """(n,) rad (m), what the harmonics are added to."""
        place: Array = getattr(self, fields(self)[1].name)
        return place

    @property
    def amplitudes(self) -> dict[str, Array]:
        """The amplitudes by their field, each (n, N)."""
        return {each.name: getattr(self, each.name) for each in fields(self)[2:]}

    @property
    def coefficients(self) -> Array:
        """(m, n), the amplitudes one below the other."""
        return np.hstack(list(self.amplitudes.values())).T

    @property
    def harmonics(self) -> int:
        """Number of harmonics, N."""
        return next(iter(self.amplitudes.values())).shape[1]

    @property
    def duration(self) -> float:
        """The period, s."""
        return 1.0 / self.base_frequency

    @property
    def highest_frequency(self) -> float:
        """Frequency of the last harmonic, Hz."""
        return self.base_frequency * self.harmonics

    def scaled(self, factor: float | Array) -> Self:
        """The motion with its amplitudes about the place multiplied by a number or by (n,) numbers."""
        row = np.broadcast_to(factor, (self.joints,))[:, None]
        scaled: dict[str, Any] = {name: row * value for name, value in self.amplitudes.items()}
        return replace(self, **scaled)

    def rest_conditions(self) -> dict[str, tuple[Array, float, str]]:
        """By amplitude: sums (n,) that vanish in a motion that starts at rest, their scale, the condition."""
        return {}

    @classmethod
    def from_dict(cls, data: dict[str, Any]) -> Self:
        """The inverse of ``to_dict``. Raises InputError for missing, misshapen or moving-start values."""
        first, place, *amplitudes = (each.name for each in fields(cls))
        values: dict[str, Any] = {first: positive(data, first, "Hz"), place: numbers(data, place, 1)}
        shape = (len(values[place]), numbers(data, amplitudes[0], 2).shape[1])
        values |= {name: rows(data, name, shape) for name in amplitudes}
        found = cls(**values)
        for name, (sums, scale, condition) in found.rest_conditions().items():
            if np.abs(sums).max() > REST_TOLERANCE * scale:
                expected = f"a start at rest: {condition} for every joint"
                raise InputError("trajectory", name, expected, f"sums {sums.tolist()}")
        return found


@dataclass(frozen=True)
class LinearBasis(ABC):
    """The free coefficients of a kind of trajectory, the place first.

    base_frequency: Hz. harmonics: N. fewest, why: of harmonics, and what they are needed for.
    """

    base_frequency: float
    harmonics: int
    fewest: ClassVar[int]
    why: ClassVar[str] = ""

    def __post_init__(self) -> None:
        if self.harmonics < self.fewest:
            raise InputError("excitation", "harmonics", f"at least {self.fewest}{self.why}", self.harmonics)
        if not 0 < self.base_frequency < np.inf:
            raise InputError("excitation", "base_frequency", "a positive number of Hz", self.base_frequency)

    @property
    @abstractmethod
    def combinations(self) -> Array:
        """(m, size - 1): the columns' coefficients that each free coefficient but the place stands for."""

    @abstractmethod
    def columns(self, time: Array) -> tuple[Array, Array, Array]:
        """Each (N, m): what the combinations are of, in q - place, dq and ddq at the times (N,) s."""

    @property
    def duration(self) -> float:
        """Until the motion repeats, s."""
        return 1.0 / self.base_frequency

    @property
    def highest_frequency(self) -> float:
        """Frequency of the last harmonic, Hz."""
        return self.base_frequency * self.harmonics

    @property
    def size(self) -> int:
        """Free coefficients a joint, the place first."""
        return 1 + self.combinations.shape[1]

    def matrices(self, time: Array) -> tuple[Array, Array, Array]:
        """Each (N, size): q, dq and ddq of a joint at the times (N,) are these times its coefficients."""
        return with_constant(*(part @ self.combinations for part in self.columns(time)))
