"""A dcmotor without inputs and electricity: MuJoCo's own LuGre friction and cogging on a joint."""

from typing import Any

import mujoco
import numpy as np

from ..robot import Robot
from .mjcf_form import joint_element

# Bristles where only the steady state matters: they give way within this angle, rad.
PRESLIDING = 5e-4
# Of the bristles with the joint's inertia; undamped ones ring in every reversal.
BRISTLE_DAMPING_RATIO = 0.3
NOTHING = (0.0, 0.0, 0.0)
WITHOUT_INPUTS = int(mujoco.mjtCtrlInput.mjINPUT_NONE)


def passive_device(
    spec: Any,
    robot: Robot,
    joint: int,
    name: str,
    lugre: tuple[float, float, float] = NOTHING,
    cogging: tuple[float, float, float] = NOTHING,
    bristles: tuple[float, float] | None = None,
) -> None:
    """Add a passive dcmotor to a joint.

    lugre: Coulomb and static friction, N·m, and the Stribeck velocity, rad/s; it replaces the joint's
    frictionloss. bristles: their stiffness, N·m/rad, and damping ratio with the joint's inertia; where only
    sliding matters, None. cogging: amplitude N·m, whole cycles a revolution,
    phase rad; the torque amplitude·sin(cycles q + phase) is added to the joint.
    """
    element = joint_element(spec, robot, joint)
    device = spec.add_actuator(name=_free_name(spec, f"{element.name}_{name}"), target=element.name)
    device.trntype = mujoco.mjtTrn.mjTRN_JOINT
    static, friction = lugre[1], [0.0] * 5
    if static > 0.0:
        stiffness, ratio = bristles or (static / PRESLIDING, BRISTLE_DAMPING_RATIO)
        inertia = float(robot.model.dof_M0[robot.chain.in_tree[joint]])
        friction = [stiffness, 2 * ratio * float(np.sqrt(stiffness * inertia)), *lugre]
        element.frictionloss = 0.0
    device.set_to_dcmotor(
        motorconst=[0.0, 0.0],
        resistance=1.0,
        cogging=list(cogging),
        lugre=friction,
        ctrlspec=WITHOUT_INPUTS,
    )


def coulomb_level(spec: Any, robot: Robot, joint: int) -> float:
    """The joint's frictionloss in the spec, N·m."""
    return float(joint_element(spec, robot, joint).frictionloss)


def _free_name(spec: Any, name: str) -> str:
    taken = {actuator.name for actuator in spec.actuators}
    number = 2
    free = name
    while free in taken:
        free, number = f"{name}_{number}", number + 1
    return free
