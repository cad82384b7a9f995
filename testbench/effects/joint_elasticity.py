"""Joint elasticity: motor and link apart, joined by a spring."""

from collections.abc import Mapping, Sequence
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from ..robot import Robot
from .action import (
    DAMPING,
    LINK_POSITION,
    POSITION,
    READING,
    STATIC_LOAD,
    STIFFNESS,
    Action,
    SimulatedRobot,
    Stage,
    bus_row,
    hook,
    hook_kernel,
    require_joint,
    vector,
)
from .base import EffectDescription, EffectParameter, Injection, Scope
from .link_motion import elastic_change, link_row, typical_inertia
from .mjcf_form import joint_element
from .signature import Family, Logged, Member, Quantity, grid_family

Array = NDArray[np.float64]

DESCRIPTION = EffectDescription(
    name="joint_elasticity",
    title="Joint elasticity",
    law="transmitted torque = stiffness·w + damping·dw/dt, w = q_motor - q_link (two_mass); hardening: the "
    "stiffness doubles at a windup of 4 mrad; quasi_static: the encoder reads the windup under gravity and "
    "Coriolis torque, the masses stay together",
    reference='Spong, "Modeling and control of elastic joint robots", J. Dyn. Sys. 109(4), 1987; Tuttle & '
    'Seering, "A nonlinear model of a harmonic drive gear transmission", IEEE T-RA 12(3), 1996',
    scope=Scope.JOINT,
    parameters=(
        EffectParameter("stiffness", "N·m/rad", 0.0, np.inf, (9000.0, 1500.0), "inertia"),
        EffectParameter("damping", "N·m·s/rad", 0.0, np.inf, (6.0, 6.0), "inertia"),
    ),
    laws=("two_mass", "hardening", "quasi_static"),
    confused_with=("torque_delay", "actuator_lag", "backlash"),
)

# Windup at which a hardening spring is twice as stiff, rad.
HARDENING_WINDUP = 4e-3
# Share of the rotor's inertia that is put between the spring and the play of one joint in MJCF.
BETWEEN = 0.01
# Hz, of the joint's whole inertia on the spring: steps of a third, which a refinement closes.
FREQUENCIES = (4.5, 6.0, 8.0, 10.7, 14.2, 19.0)
# Of the two springs that a member mixes, with that inertia.
DAMPING_RATIOS = (0.02, 0.1)
# A spring of which less shows is as good as rigid.
LEAST_SHARE = 1e-9
PER_JOINT_NUMERICS = ("velocity_limit", "acceleration_limit")


def action(injection: Injection, simulated: SimulatedRobot) -> Action:
    """A spring between motor and link; an infinitely stiff one is a rigid joint."""
    joint = require_joint(DESCRIPTION.name, injection.joint, simulated.robot.joints)
    values = [injection.values[name] for name in ("stiffness", "damping")]
    if np.isinf(values[0]):
        return Action()
    if injection.law == "quasi_static":
        return Action((hook(Stage.ENCODER, _static_windup, joint, values),))
    hardening = 1 / HARDENING_WINDUP**2 if injection.law == "hardening" else 0.0
    return Action((hook(Stage.TRANSMISSION, _spring, joint, [*values, hardening]),), split=joint)


@hook_kernel
def _spring(bus: int, parameters: int, state: int, joint: int) -> None:
    row, value = bus_row(bus, joint), vector(parameters, 3)
    windup = row[POSITION] - row[LINK_POSITION]
    row[STIFFNESS] = value[0] * (1.0 + value[2] * windup * windup)
    row[DAMPING] = value[1]


@hook_kernel
def _static_windup(bus: int, parameters: int, state: int, joint: int) -> None:
    row, value = bus_row(bus, joint), vector(parameters, 2)
    row[READING] += row[STATIC_LOAD] / value[0]


def signature(runs: Sequence[Logged], joint: int | None, into: int | None) -> Family:
    """The change of torque where the link follows the logged motor through a spring, at all joints.

    One member a stiffness K. Its two coefficients mix a little and a well damped spring: with a sum of 1
    they are a damping in between, and slow motion, which shows the windup alone, tells K over their sum.
    """
    joint = require_joint(DESCRIPTION.name, joint, runs[0].joints)
    inertia = typical_inertia(runs[0], joint)
    links = [link_row(run, joint) for run in runs]

    def dampings(stiffness: float) -> Array:
        return np.array([2 * ratio * np.sqrt(stiffness * inertia) for ratio in DAMPING_RATIOS])

    def member(shape: Mapping[str, float]) -> Member:
        stiffness = shape["stiffness"]
        columns = tuple(
            np.stack([elastic_change(link, stiffness, d) for d in dampings(stiffness)], axis=2)
            for link in links
        )
        return Member(dict(shape), tuple(range(runs[0].joints)), columns, np.zeros(2), np.full(2, np.inf))

    def parameters(member: Member, c: Array, covariance: Array) -> dict[str, Quantity]:
        stiffness = member.shape["stiffness"]
        return _parameters(stiffness, dampings(stiffness), c, covariance)

    grid = {"stiffness": [(2 * np.pi * frequency) ** 2 * inertia for frequency in FREQUENCIES]}
    return grid_family(DESCRIPTION.name, joint, member, grid, parameters)


def _parameters(shape: float, dampings: Array, c: Array, covariance: Array) -> dict[str, Quantity]:
    """Stiffness and damping with first-order standard deviations.

    shape: N·m/rad. dampings: (2,) N·m·s/rad of the columns. covariance: of c and then, if refined, the shape.
    """
    share = max(float(c.sum()), LEAST_SHARE)
    # Between a resonance, where reciprocals mix, and slow motion, where the dampings do.
    mixed = float(np.exp(np.log(dampings) @ c / share))
    stiffness, damping = shape / share, mixed / share
    gradients = np.array(
        [
            [-stiffness / share, -stiffness / share, 1 / share],
            # The columns' dampings grow as the root of the shape.
            [*(damping / share * (np.log(dampings / mixed) - 1)), damping / (2 * shape)],
        ]
    )[:, : len(covariance)]
    std = np.sqrt(np.maximum(np.diag(gradients @ covariance @ gradients.T), 0.0))
    return {
        "stiffness": Quantity(stiffness, float(std[0]), "N·m/rad"),
        "damping": Quantity(damping, float(std[1]), "N·m·s/rad"),
    }


def write(spec: Any, robot: Robot, injection: Injection) -> tuple[str, ...]:
    """A second joint about the same axis, a spring; the first keeps rotor, friction and motor."""
    joint = require_joint(DESCRIPTION.name, injection.joint, robot.joints)
    if injection.law == "quasi_static":
        return ("MuJoCo's joint sensors cannot read a windup that moves no mass",)
    stiffness = injection.values["stiffness"]
    if np.isinf(stiffness):
        return ()
    link = add_link_joint(spec, robot, joint, "elasticity")
    hardening = stiffness / HARDENING_WINDUP**2 if injection.law == "hardening" else 0.0
    link.stiffness = [stiffness, 0.0, hardening]
    link.damping = [injection.values["damping"], 0.0, 0.0]
    return ()


def add_link_joint(spec: Any, robot: Robot, joint: int, name: str) -> Any:
    """A joint (MjsJoint) on the body and axis of a robot's joint, where the link leaves the motor."""
    motor = joint_element(spec, robot, joint)
    index = [element.name for element in spec.joints].index(motor.name)
    for numeric in spec.numerics:
        # One value a joint, which load_robot checks.
        if numeric.name in PER_JOINT_NUMERICS:
            limits = list(numeric.data)
            numeric.data = limits[: index + 1] + limits[index:]
            numeric.size = len(limits) + 1
    for other in motor.parent.joints[1:]:
        if other.name.startswith(motor.name) and other.armature == 0.0:
            # Two joints in a row without a mass between them have no inertia matrix.
            other.armature = BETWEEN * robot.model.dof_armature[joint]
    slide = bool(robot.chain.is_slide[joint])
    kind = mujoco.mjtJoint.mjJNT_SLIDE if slide else mujoco.mjtJoint.mjJNT_HINGE
    link = motor.parent.add_joint(name=f"{motor.name}_{name}", type=kind, pos=motor.pos, axis=motor.axis)
    # Defaults of the model's joints are not meant for this one.
    link.stiffness, link.damping = [0.0] * 3, [0.0] * 3
    link.armature = link.frictionloss = 0.0
    link.limited = mujoco.mjtLimited.mjLIMITED_FALSE
    link.actfrclimited = mujoco.mjtLimited.mjLIMITED_FALSE
    return link
