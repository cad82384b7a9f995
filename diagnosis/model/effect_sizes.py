"""Size of an effect, relative to that on healthy robots and to what no arm has."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from identification.parameters import COULOMB, PER_JOINT, VISCOUS
from testbench.effects import fitted_effect
from testbench.effects.fitted_effect import FittedEffect
from testbench.effects.signature import Quantity
from testbench.effects.size import typical_range
from testbench.robot import Robot

from .candidate import Candidate

Array = NDArray[np.float64]

# Share of a joint's RMS torque from which an effect is worth fitting.
SMALLEST_TORQUE = 0.005


def is_excessive(robot: Robot, candidate: Candidate, coefficients: Array, share: float) -> bool:
    """Whether an effect is more than any robot has.

    share: of its joint's squared residual that it explains.
    """
    return fitted_effect.is_excessive(_fitted(robot, np.zeros(robot.joints), candidate, coefficients), share)


def is_beyond_healthy(robot: Robot, torque_scale: Array, candidate: Candidate, coefficients: Array) -> bool:
    """Whether an effect is larger than what a healthy robot has of it; arguments as of ``size``."""
    if not fitted_effect.is_distinct(_fitted(robot, torque_scale, candidate, coefficients)):
        return False
    return times_healthy(robot, torque_scale, candidate, coefficients) > 1


def times_healthy(robot: Robot, torque_scale: Array, candidate: Candidate, coefficients: Array) -> float:
    """Size of an effect as a multiple of the largest on a healthy robot; arguments as of ``size``."""
    description, joint = candidate.description, candidate.family.joint
    healthy, alone = description.healthy, description.healthy_alone
    if joint is not None and alone is not None:
        healthy = alone
    if description.of_sample:
        mild, _ = typical_range(description.parameters[0], robot, joint)
        healthy = max(healthy, description.of_sample * candidate.sample_time / mild)
    largest = size(robot, torque_scale, candidate, coefficients)
    return largest / healthy if healthy > 0 else np.inf * largest


def is_plausible(robot: Robot, candidate: Candidate, coefficients: Array) -> bool:
    """Whether the effect's parameters are within their bounds, and such as one can have."""
    return fitted_effect.is_plausible(_fitted(robot, np.zeros(robot.joints), candidate, coefficients))


def quantities(candidate: Candidate, coefficients: Array) -> dict[str, Quantity]:
    """An effect's parameters by name, without their deviations."""
    count = candidate.count + len(candidate.family.refine)
    return candidate.family.parameters(candidate.member, coefficients, np.zeros((count, count)))


def size(robot: Robot, torque_scale: Array, candidate: Candidate, coefficients: Array) -> float:
    """An effect's size as a multiple of the mild end of its typical range on this robot's joint.

    torque_scale: (n,) N·m, a typical torque of each joint, for what has no scale of its own there.
    """
    return fitted_effect.size(_fitted(robot, torque_scale, candidate, coefficients))


def _fitted(robot: Robot, torque_scale: Array, candidate: Candidate, coefficients: Array) -> FittedEffect:
    """The effect as its own file judges it; arguments as of ``size``."""
    joint = candidate.family.joint
    each = (torque_scale, candidate.position_step)
    torque, step = (0.0 if joint is None else float(of_joints[joint]) for of_joints in each)
    return FittedEffect(
        description=candidate.description,
        robot=robot,
        joint=joint,
        member=candidate.member,
        coefficients=coefficients,
        values=quantities(candidate, coefficients),
        torque=torque,
        seconds=candidate.sample_time * candidate.samples,
        position_step=step,
    )


def with_friction(robot: Robot, parameters: Array) -> Robot:
    """The robot with the larger of its model's friction and these standard parameters' (14 n,)."""
    table = robot.parameters.reshape(-1, PER_JOINT).copy()
    fitted = parameters.reshape(-1, PER_JOINT)
    for column in (VISCOUS, COULOMB):
        table[:, column] = np.maximum(table[:, column], fitted[:, column])
    return replace(robot, parameters=table.ravel())
