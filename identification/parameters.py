"""The standard parameters of a chain: their order, names, units and values.

Every joint has 14 standard parameters, in this order (Khalil & Dombre, "Modeling,
Identification and Control of Robots", 2004, ch. 9, and friction with offset):

    XX XY XZ YY YZ ZZ   inertia about the link frame's origin, kg·m²
    MX MY MZ            first moments, kg·m
    M                   mass, kg
    Ia                  rotor inertia seen from the joint (armature), kg·m² (kg for a slide joint)
    fv                  viscous friction, N·m·s/rad (N·s/m)
    fc                  Coulomb friction, N·m (N)
    off                 constant offset of the torque, N·m (N)

A vector of standard parameters is joint-major, shape (14 n,); those of joints that follow others come last,
and of them only the ten of their links count (see followers.py).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .errors import InputError

SYMBOLS = ("XX", "XY", "XZ", "YY", "YZ", "ZZ", "MX", "MY", "MZ", "M", "Ia", "fv", "fc", "off")
PER_JOINT = len(SYMBOLS)
INERTIAL = 10
MASS, ARMATURE, VISCOUS, COULOMB, OFFSET = 9, 10, 11, 12, 13

GROUPS: dict[str, tuple[int, ...]] = {
    "inertial": tuple(range(INERTIAL)),
    "armature": (ARMATURE,),
    "viscous": (VISCOUS,),
    "coulomb": (COULOMB,),
    "offset": (OFFSET,),
}
DEFAULT_GROUPS = ("inertial", "armature", "viscous", "coulomb")


@dataclass(frozen=True)
class StandardParameter:
    """One standard parameter: its name, such as ``XX_2``, its joint (from 0) and its SI unit."""

    name: str
    joint: int
    symbol: str
    unit: str


def standard_parameters(is_slide: Sequence[bool] | NDArray[np.bool_]) -> tuple[StandardParameter, ...]:
    """The 14 n standard parameters of a chain, in the order of every standard vector here."""
    parameters = []
    for joint, slide in enumerate(is_slide):
        units = ["kg·m²"] * 6 + ["kg·m"] * 3 + ["kg"]
        units += ["kg", "N·s/m", "N", "N"] if slide else ["kg·m²", "N·m·s/rad", "N·m", "N·m"]
        for symbol, unit in zip(SYMBOLS, units, strict=True):
            parameters.append(StandardParameter(f"{symbol}_{joint + 1}", joint, symbol, unit))
    return tuple(parameters)


def group_columns(joints: int, groups: Sequence[str]) -> NDArray[np.int64]:
    """Indices into the standard vector of the chosen parameter groups, ascending.

    Raises InputError for a group that does not exist.
    """
    for group in groups:
        if group not in GROUPS:
            raise InputError("parameters", "groups", "names of parameter groups", repr(group), GROUPS)
    within = sorted(index for group in set(groups) for index in GROUPS[group])
    return np.array(
        [PER_JOINT * joint + index for joint in range(joints) for index in within], dtype=np.int64
    )


def without_friction(parameters: NDArray[np.float64]) -> NDArray[np.float64]:
    """Standard parameters (14 n,) with no friction and no offset of any joint."""
    table = parameters.reshape(-1, PER_JOINT).copy()
    table[:, [VISCOUS, COULOMB, OFFSET]] = 0.0
    return table.ravel()


def inertial_parameters(
    mass: float, center: NDArray[np.float64], inertia_at_center: NDArray[np.float64]
) -> NDArray[np.float64]:
    """[XX XY XZ YY YZ ZZ MX MY MZ M] about the frame's origin, shape (10,).

    ``center`` (3,) in m and ``inertia_at_center`` (3, 3) in kg·m² are in the frame's axes; the
    inertia is moved to the origin by the parallel-axis theorem.
    """
    first = mass * center
    inertia = inertia_at_center + mass * (center @ center * np.eye(3) - np.outer(center, center))
    upper = inertia[[0, 0, 0, 1, 1, 2], [0, 1, 2, 1, 2, 2]]
    return np.concatenate([upper, first, [mass]])


def pseudo_inertia(inertial: NDArray[np.float64]) -> NDArray[np.float64]:
    """The 4 x 4 pseudo-inertia of ten inertial parameters; physically consistent iff positive definite.

    Wensing, Kim & Slotine, "Linear matrix inequalities for physically consistent inertial
    parameter identification", RA-L 2018, eq. 11.
    """
    xx, xy, xz, yy, yz, zz = inertial[:6]
    inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    out = np.empty((4, 4))
    out[:3, :3] = 0.5 * np.trace(inertia) * np.eye(3) - inertia
    out[:3, 3] = out[3, :3] = inertial[6:9]
    out[3, 3] = inertial[9]
    return out
