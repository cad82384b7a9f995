"""The simulated robot under the controller of the logs, as an estimator may call it.

Estimators that compare the robot with a simulation of itself (output error, DIDIM, instrumental
variables) need the same reference and the same controller with candidate parameters in the plant.
They know it by this protocol only; what steps the plant lies elsewhere.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from .base_parameters import BaseParameters
from .parameters import INERTIAL, PER_JOINT

Array = NDArray[np.float64]


@dataclass(frozen=True)
class SimulatedRun:
    """One run's motion without sensor noise, at the samples of its log; each (N, n), rad (m) and s."""

    q: Array
    dq: Array
    ddq: Array


class ClosedLoop(Protocol):
    """The runs of a problem, simulated with candidate parameters in the plant.

    Reference, controller and start are those of the logs, so a candidate that is the truth gives the
    motion that was logged, but for noise.
    """

    def simulate(self, candidates: Array, coarse: bool = False) -> list[tuple[SimulatedRun, ...]]:
        """Every run for each candidate, standard parameters (C, 14 n), all as one batch.

        coarse: good enough for the differences between candidates, and quicker.

        Raises InputError when a log holds no reference or controller, and for a loop that is unstable.
        """
        ...


def standard_candidate(base: BaseParameters, nominal: Array, values: Array) -> Array:
    """A standard vector (14 n,) with the base values (b,): ``nominal`` but for the leading parameters.

    The projection is the identity on the leading parameters, so that they alone can carry any correction.
    Friction, armature and offsets that were not estimated are zero, as in the equations.
    """
    standard = nominal.copy()
    estimated = np.any(base.projection != 0, axis=0)
    standard[~estimated & (np.arange(len(standard)) % PER_JOINT >= INERTIAL)] = 0.0
    standard[base.columns] += values - base.values(standard)
    return standard
