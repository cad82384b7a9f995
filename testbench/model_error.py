"""A nominal model drawn around the truth: what CAD and a data sheet would say of the robot.

A link's mass distribution is deformed as a whole: its pseudo-inertia J (Wensing, Kim & Slotine, RA-L 2018)
becomes s A J A', with a scale s of the mass and an affine map A of the material's points. Whatever is
drawn, the result is positive definite, so every link stays one that could be built.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from identification.errors import InputError
from identification.parameters import ARMATURE, COULOMB, INERTIAL, PER_JOINT, VISCOUS, pseudo_inertia

from .model_file import write_model
from .robot import Robot, load_robot

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ModelError:
    """How far a nominal model strays; standard deviations. Raises InputError for a negative one.

    mass: relative. centre: of the centre of mass, as a share of the link's radius of gyration. shape: of
    the link's extents, relative. armature, viscous, coulomb: relative.
    """

    mass: float = 0.06
    centre: float = 0.06
    shape: float = 0.05
    armature: float = 0.08
    viscous: float = 0.2
    coulomb: float = 0.15

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not (np.isfinite(value) and value >= 0):
                raise InputError("model_error", name, "a standard deviation of 0 or more", value)

    def scaled(self, factor: float) -> "ModelError":
        """Every deviation multiplied."""
        return ModelError(**{name: factor * value for name, value in vars(self).items()})


def nominal_parameters(robot: Robot, error: ModelError, seed: int | np.random.SeedSequence) -> Array:
    """Standard parameters (14 n,) drawn around the robot's; every link physically consistent.

    Masses, rotors and friction are scaled by exp(deviation·normal), so they stay positive.
    """
    rng = np.random.default_rng(seed)
    table = robot.parameters.reshape(-1, PER_JOINT).copy()
    for row in table:
        row[:INERTIAL] = _deformed(row[:INERTIAL], error, rng)
        for column, deviation in (
            (ARMATURE, error.armature),
            (VISCOUS, error.viscous),
            (COULOMB, error.coulomb),
        ):
            row[column] *= np.exp(deviation * rng.standard_normal())
    return table.ravel()


def nominal_model(robot: Robot, error: ModelError, seed: int | np.random.SeedSequence, path: Path) -> Robot:
    """Write a nominal model drawn around the robot's as MJCF to ``path``, and read it. Raises InputError."""
    write_model(robot, nominal_parameters(robot, error, seed), path)
    return load_robot(path)


def _deformed(inertial: Array, error: ModelError, rng: np.random.Generator) -> Array:
    """Ten inertial parameters of the deformed link, about the same frame."""
    scale, stretch, shift = (
        np.exp(error.mass * rng.standard_normal()),
        rng.normal(size=(3, 3)),
        rng.normal(size=3),
    )
    mass = inertial[9]
    if mass <= 0:
        return inertial
    pseudo = pseudo_inertia(inertial)
    centre = pseudo[:3, 3] / mass
    spread = pseudo[:3, :3] / mass - np.outer(centre, centre)
    radius = np.sqrt(max(float(np.trace(spread)), 0.0))
    # Half of each, so that a symmetric stretch has the deviation asked for.
    linear = np.eye(3) + error.shape * (stretch + stretch.T) / 2
    affine = np.eye(4)
    affine[:3, :3] = linear
    affine[:3, 3] = centre - linear @ centre + error.centre * radius * shift
    return _inertial(scale * affine @ pseudo @ affine.T)


def _inertial(pseudo: Array) -> Array:
    """[XX XY XZ YY YZ ZZ MX MY MZ M] of a 4 x 4 pseudo-inertia."""
    inertia = np.trace(pseudo[:3, :3]) * np.eye(3) - pseudo[:3, :3]
    upper = inertia[[0, 0, 0, 1, 1, 2], [0, 1, 2, 1, 2, 2]]
    return np.concatenate([upper, pseudo[:3, 3], pseudo[3:, 3]])
