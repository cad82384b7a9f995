"""How far a model's parameters may be from the robot's before that itself needs explaining.

Widths of what one expects of CAD and data sheets, one standard deviation; a scale of links and rotors and
one of friction and offsets are estimated with the fit (a heavy-tailed prior: the penalty grows like a
logarithm, so a model that is worse than expected throughout is not held against any effect).
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from .base_parameters import BaseParameters
from .parameters import ARMATURE, COULOMB, OFFSET, PER_JOINT, VISCOUS

Array = NDArray[np.float64]

MASS, CENTRE, INERTIA = 0.10, 0.02, 0.20
ROTOR, FRICTION = 0.20, 0.35
OFFSET_SHARE = 0.03
# What a model has none of at all, as a URDF has no friction and no rotors, may need any part of the torque.
UNMODELLED = 1.0
# Coulomb friction is about this share of a joint's torque, where a model does not say.
COULOMB_SHARE = 0.2
# Half a size of this share of the arm's largest link stands in where a model has next to nothing.
FLOOR = 0.01
# Torque and position are sampled up to two milliseconds apart.
TIMING = 0.7e-3


@dataclass(frozen=True)
class BasePrior:
    """Gaussian prior of base parameters about the model's.

    mean: (b,). covariance: (b, b), of widths taken at their word. strength: factor on its inverse.
    """

    mean: Array
    covariance: Array
    strength: float = 1.0

    @cached_property
    def precision(self) -> Array:
        """Inverse of the covariance, (b, b), at strength 1."""
        scale = np.sqrt(np.diag(self.covariance))
        inverse = np.linalg.inv(self.covariance / np.outer(scale, scale))
        return 0.5 * (inverse + inverse.T) / np.outer(scale, scale)

    @cached_property
    def root(self) -> Array:
        """Upper triangular (b, b) R with R'R the precision."""
        return np.asarray(np.linalg.cholesky(self.precision).T, dtype=np.float64)

    def of_strength(self, strength: float) -> "BasePrior":
        """The same prior held to more or less."""
        return replace(self, strength=strength)


def base_prior(base: BaseParameters, nominal: Array, widths: Array) -> BasePrior:
    """The prior that standard parameters ``nominal`` with ``widths``, (14 n,) each, imply."""
    return BasePrior(base.values(nominal), (base.projection * widths**2) @ base.projection.T)


def parameter_widths(
    nominal: Array, torque_scale: Array, speed_scale: Array, acceleration_scale: Array
) -> Array:
    """Standard deviations (14 links,) of the robot's standard parameters about the model's.

    torque_scale, speed_scale, acceleration_scale: (n,) N·m, rad/s (m/s), rad/s² (m/s²), typical of a joint;
    friction and rotors that the model leaves out are judged by them.
    """
    table = nominal.reshape(-1, PER_JOINT)
    mass = np.maximum(table[:, 9], FLOOR * table[:, 9].max())
    size = np.sqrt(np.maximum(np.trace(_inertia(table), axis1=1, axis2=2) / (2 * mass), CENTRE**2))
    whole = np.ones_like(table)
    whole[:, :6] = (INERTIA * mass * size**2 + MASS * mass * size**2)[:, None]
    whole[:, 6:9] = (np.hypot(CENTRE, MASS * size) * mass)[:, None]
    whole[:, 9] = MASS * mass
    # Rotors and friction of followers are in no torque: any width will do.
    joints = len(torque_scale)
    out, table = whole[:joints], table[:joints]
    out[:, ARMATURE] = ROTOR * table[:, ARMATURE] + FLOOR * (mass * size**2)[:joints]
    out[:, VISCOUS] = FRICTION * table[:, VISCOUS] + FLOOR * torque_scale
    out[:, COULOMB] = FRICTION * table[:, COULOMB] + FLOOR * torque_scale
    out[:, OFFSET] = OFFSET_SHARE * table[:, COULOMB] + 1e-3 * torque_scale
    is_unmodelled = table[:, COULOMB] == 0
    out[is_unmodelled, OFFSET] += (OFFSET_SHARE * COULOMB_SHARE * torque_scale)[is_unmodelled]
    most = UNMODELLED * torque_scale
    for column, width in (
        (ARMATURE, most / acceleration_scale),
        (VISCOUS, most / speed_scale),
        (COULOMB, most),
    ):
        out[:, column] = np.where(table[:, column] == 0, np.maximum(out[:, column], width), out[:, column])
    return whole.ravel()


def _inertia(table: Array) -> Array:
    """Rotational inertia of each link about its origin, (n, 3, 3)."""
    out = np.zeros((len(table), 3, 3))
    rows, columns = [0, 0, 0, 1, 1, 2], [0, 1, 2, 1, 2, 2]
    out[:, rows, columns] = out[:, columns, rows] = table[:, :6]
    return out
