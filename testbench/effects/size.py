"""How large an effect is on an arm like this one: typical ranges in SI units."""

from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from identification.errors import InputError
from identification.inverse_dynamics import inverse_dynamics
from identification.parameters import ARMATURE, COULOMB, INERTIAL, PER_JOINT, VISCOUS

from ..robot import Limits, Robot
from .base import EffectDescription, EffectParameter

Array = NDArray[np.float64]

POSES = 200
# Of the speed limit: a speed that joints work at.
WORKING_SPEED = 0.3
# A wrist that carries nothing yet is made to: its link counts as this share of all that its motor moves.
LIGHTEST_LINK = 0.05
# Where a model states no limit: half a turn, and a speed and a torque that arms of any size know.
POSITION_RANGE, SPEED, TORQUE = np.pi, 3.0, 50.0


def typical_range(parameter: EffectParameter, robot: Robot, joint: int | None) -> tuple[float, float]:
    """(mild, severe) values of a parameter on this robot's joint, SI, inside its bounds.

    Raises InputError for a parameter that scales with something unknown.
    """
    scale = scale_of(parameter.relative_to, robot, joint)
    mild, severe = (
        float(np.clip(scale * end, parameter.lower, parameter.upper)) for end in parameter.typical
    )
    return mild, severe


def typical_values(
    description: EffectDescription, robot: Robot, joint: int | None, severity: float = 0.5
) -> dict[str, float]:
    """Every parameter at ``severity`` of its typical range: 0 is mild, 1 severe."""
    ranges = ((p.name, typical_range(p, robot, joint)) for p in description.parameters)
    return {name: mild + severity * (severe - mild) for name, (mild, severe) in ranges}


def scale_of(relative_to: str, robot: Robot, joint: int | None) -> float:
    """What a typical range is a share of, SI; 1 for "".

    coulomb: N·m. viscous: N·m·s/rad. viscous_torque: N·m at the speed limit. torque_limit: N·m.
    gravity: N·m, RMS over poses. link_inertia: kg·m², the joint's own without its rotor, RMS over poses; of
    LIGHTEST_LINK of that with it, at least. friction_power: W, at WORKING_SPEED.
    """
    if not relative_to:
        return 1.0
    scales = _scales(_Key(robot))
    if relative_to not in scales:
        raise InputError("effects", "relative_to", "a known scale", repr(relative_to), scales)
    if joint is None:
        raise InputError("effects", "relative_to", "a joint to scale with", "none")
    return float(scales[relative_to][joint])


def speed_limit(limits: Limits, joint: int) -> float:
    """The joint's speed limit, rad/s or m/s; where it has none, what arms of any size know."""
    limit = float(limits.velocity[joint])
    return limit if np.isfinite(limit) else SPEED


class _Key:
    """A robot as a key: equal when it is the same object."""

    def __init__(self, robot: Robot):
        self.robot = robot

    def __hash__(self) -> int:
        return id(self.robot)

    def __eq__(self, other: Any) -> bool:
        return isinstance(other, _Key) and other.robot is self.robot


@lru_cache(maxsize=16)
def _scales(key: _Key) -> dict[str, Array]:
    robot = key.robot
    n = robot.joints
    every = robot.parameters.reshape(-1, PER_JOINT)
    table = every[:n]
    limits = robot.limits
    lower = np.where(np.isfinite(limits.lower), limits.lower, -POSITION_RANGE)
    upper = np.where(np.isfinite(limits.upper), limits.upper, POSITION_RANGE)
    rng = np.random.default_rng(0)
    poses = rng.uniform(lower, upper, (POSES, n))
    still = np.zeros_like(poses)
    links = every.copy()
    links[:, INERTIAL:] = 0.0
    chain = robot.chain.without_springs()
    gravity = inverse_dynamics(chain, links.ravel(), poses, still, still, threads=1)
    inertia = np.empty((POSES, n))
    for joint, unit in enumerate(np.eye(n)):
        moved = inverse_dynamics(chain, links.ravel(), poses, still, still + unit, threads=1)
        inertia[:, joint] = (moved - gravity)[:, joint]
    link = np.sqrt(np.mean(inertia**2, axis=0))
    speed = np.array([speed_limit(limits, joint) for joint in range(n)])
    working = WORKING_SPEED * speed
    return {
        "coulomb": table[:, COULOMB],
        "viscous": table[:, VISCOUS],
        "viscous_torque": table[:, VISCOUS] * speed,
        "torque_limit": np.where(np.isfinite(limits.torque), limits.torque, TORQUE),
        "gravity": np.sqrt(np.mean(gravity**2, axis=0)),
        "link_inertia": np.maximum(link, LIGHTEST_LINK * (link + table[:, ARMATURE])),
        "friction_power": (table[:, VISCOUS] * working + table[:, COULOMB]) * working,
    }
