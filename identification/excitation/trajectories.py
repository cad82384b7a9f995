"""Every kind of trajectory by name: its free coefficients, and its JSON form."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from ..errors import InputError
from .fourier import FourierBasis, FourierSeries
from .harmonic_sines import HarmonicSines, HarmonicSinesBasis
from .modified_fourier import ModifiedFourierBasis, ModifiedFourierSeries
from .quintic import QuinticBasis, QuinticPath
from .trajectory import Trajectory, TrajectoryBasis


@dataclass(frozen=True)
class TrajectoryKind:
    """basis: of a base frequency in Hz and the number of harmonics (segments of a quintic path).

    read: the trajectory of its JSON form.
    """

    basis: Callable[[float, int], TrajectoryBasis[Any]]
    read: Callable[[dict[str, Any]], Trajectory]


TRAJECTORIES: Mapping[str, TrajectoryKind] = {
    "fourier": TrajectoryKind(FourierBasis, FourierSeries.from_dict),
    "harmonic_sines": TrajectoryKind(HarmonicSinesBasis, HarmonicSines.from_dict),
    "modified_fourier": TrajectoryKind(ModifiedFourierBasis, ModifiedFourierSeries.from_dict),
    "quintic": TrajectoryKind(QuinticBasis, QuinticPath.from_dict),
}


def trajectory_basis(name: str, base_frequency: float, harmonics: int) -> TrajectoryBasis[Any]:
    """The free coefficients of a kind of trajectory; ``base_frequency`` Hz repeats it.

    Raises InputError for a name that does not exist and for numbers that the kind cannot do with.
    """
    if name not in TRAJECTORIES:
        raise InputError("excitation", "trajectory", "a kind of trajectory", repr(name), TRAJECTORIES)
    return TRAJECTORIES[name].basis(base_frequency, harmonics)


def trajectory_from_dict(data: Any) -> Trajectory:
    """The trajectory that ``to_dict`` described. Raises InputError that names what is wrong."""
    name = data.get("type") if isinstance(data, dict) else data
    if not isinstance(name, str) or name not in TRAJECTORIES:
        raise InputError("trajectory", "type", "a known trajectory type", repr(name), TRAJECTORIES)
    return TRAJECTORIES[name].read(data)
