"""Joint elasticity: motor and link apart, joined by a spring."""

from collections.abc import Mapping, Sequence
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from identification.parameters import ARMATURE, PER_JOINT

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
from .columns import by_run
from .experiment import Experiment
from .link_motion import elastic_change, link_row, typical_link_inertia
from .mjcf_form import joint_element
from .signature import Family, Logged, Member, Quantity

Array = NDArray[np.float64]

DESCRIPTION = EffectDescription(
    name="joint_elasticity",
    title="Joint elasticity",
    law="transmitted torque = stiffness·w + damping·dw/dt, w = q_motor - q_link (two_mass); hardening: the "
    "stiffness doubles at a windup of doubling_windup; quasi_static: the encoder reads the windup under "
    "gravity and Coriolis torque, the masses stay together",
    reference='Spong, "Modeling and control of elastic joint robots", J. Dyn. Sys. 109(4), 1987; Tuttle & '
    'Seering, "A nonlinear model of a harmonic drive gear transmission", IEEE T-RA 12(3), 1996',
    scope=Scope.JOINT,
    parameters=(
        EffectParameter("stiffness", "N·m/rad", 1e-3, np.inf, (18000.0, 2000.0), "link_inertia"),
        EffectParameter("damping", "N·m·s/rad", 0.0, np.inf, (10.0, 10.0), "link_inertia"),
        EffectParameter("doubling_windup", "rad", 1e-6, np.inf, (4e-3, 4e-3), law="hardening"),
    ),
    laws=("two_mass", "hardening", "quasi_static"),
    confused_with=("torque_delay", "actuator_lag", "backlash"),
    shown_by=(Experiment.HIGH_FREQUENCIES,),
    of_transmission=True,
    relinearised=True,
    laws_apart=True,
    like_encoder_noise=True,
    # Where the shape is right it is 1; with less another effect looks a little like its resonance.
    least_coefficient=0.15,
    # By their first law springs that stiffen are fitted two to three times too stiff.
    healthy=0.35,
)

TWO_MASS, HARDENING, QUASI_STATIC = DESCRIPTION.laws
# Share of the rotor's inertia that is put between the spring and the play of one joint in MJCF.
BETWEEN = 0.01
# Hz, of the link on the spring while its motor holds: steps of a quarter, which a refinement closes. Most of
# a wrist's inertia is its rotor's, which has no part in this.
FREQUENCIES, LOWEST, HIGHEST = (4.5, 5.6, 7.0, 8.8, 11.0, 13.7, 17.2, 21.5), 3.0, 40.0
# With that inertia: what is looked for first, and what it may be.
DAMPING_RATIOS, LEAST_RATIO, LARGEST_RATIO = (0.03, 0.1), 0.005, 0.4
# Hz without a windup, of hardening springs; the windups at which they are twice as stiff, of what the load
# alone would make, and rad.
HARDENING_FREQUENCIES, OF_THE_LOAD, DOUBLING = (4.5, 8.0, 14.2), (0.4, 1.0), (1e-4, 2e-1)
# Likewise of one that hardly differs from a spring that does not.
HARDLY = 2.0
# The largest coefficient of one: far from 1 it is none.
MOST_HARDENING = 2.0
# A spring of which less shows is as good as rigid.
LEAST_SHARE = 1e-9
PER_JOINT_NUMERICS = ("velocity_limit", "acceleration_limit")


def action(injection: Injection, simulated: SimulatedRobot) -> Action:
    """A spring between motor and link; an infinitely stiff one is a rigid joint."""
    joint = require_joint(DESCRIPTION.name, injection.joint, simulated.robot.joints)
    values = [injection.values[name] for name in ("stiffness", "damping")]
    if np.isinf(values[0]):
        return Action()
    if injection.law == QUASI_STATIC:
        return Action((hook(Stage.ENCODER, _static_windup, joint, values),))
    return Action((hook(Stage.TRANSMISSION, _spring, joint, [*values, _hardening(injection)]),), split=joint)


def _hardening(injection: Injection) -> float:
    """How much a spring stiffens, as a share of its stiffness, a rad² of windup."""
    return injection.values["doubling_windup"] ** -2 if injection.law == HARDENING else 0.0


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

    One column a spring, whose coefficient is 1 where stiffness and damping are right. Slow motion shows the
    windup alone, and so the stiffness over the coefficient.
    """
    joint = require_joint(DESCRIPTION.name, joint, runs[0].joints)
    inertia = typical_link_inertia(runs[0], joint)
    rows = tuple(range(runs[0].joints))

    def damping(shape: Mapping[str, float]) -> float:
        return 2 * shape["damping_ratio"] * float(np.sqrt(shape["stiffness"] * inertia))

    def member(shape: Mapping[str, float]) -> Member:
        spring = shape["stiffness"], damping(shape), shape.get("doubling_windup", np.inf)
        columns = by_run(runs, lambda run: elastic_change(link_row(run, joint), *spring)[:, :, None])
        if "doubling_windup" in shape:
            return Member(dict(shape), rows, columns, np.zeros(1), np.full(1, MOST_HARDENING), HARDENING)
        return Member(dict(shape), rows, columns, np.zeros(1), np.full(1, np.inf))

    def parameters(member: Member, c: Array, covariance: Array) -> dict[str, Quantity]:
        shape = member.shape
        relative = float(np.sqrt(max(covariance[2, 2], 0.0))) / shape["damping_ratio"]
        found = {
            "stiffness": _stiffness(shape["stiffness"], float(c[0]), covariance),
            "damping": Quantity(damping(shape), damping(shape) * relative, "N·m·s/rad"),
        }
        if member.law == HARDENING:
            std = float(np.sqrt(max(covariance[3, 3], 0.0)))
            found["doubling_windup"] = Quantity(shape["doubling_windup"], std, "rad")
        return found

    def stiffness(frequency: float) -> float:
        return (2 * np.pi * frequency) ** 2 * inertia

    stiffnesses = stiffness(LOWEST), stiffness(HIGHEST)
    load = float(np.sqrt(np.mean(np.concatenate([run.load[:, joint] for run in runs]) ** 2)))
    linear = [
        {"stiffness": stiffness(each), "damping_ratio": ratio}
        for each in FREQUENCIES
        for ratio in DAMPING_RATIOS
    ]

    def hardening(spring: Mapping[str, float], share: float) -> dict[str, float]:
        doubling = float(np.clip(share * load / spring["stiffness"], *DOUBLING))
        return {**spring, "doubling_windup": doubling}

    def hardly_hardening(plain: Member) -> tuple[Member, ...]:
        if plain.law == HARDENING:
            return ()
        # By the describing function of a cubic spring, as stiff as the one that does not harden.
        less = float(np.clip(plain.shape["stiffness"] / (1 + 1.5 / HARDLY**2), *stiffnesses))
        return (member({**hardening(plain.shape, HARDLY), "stiffness": less}),)

    # Hardening that the load makes felt, wherever that is.
    felt = [
        hardening({"stiffness": stiffness(each), "damping_ratio": DAMPING_RATIOS[0]}, share)
        for each in HARDENING_FREQUENCIES
        for share in OF_THE_LOAD
    ]
    return Family(
        effect=DESCRIPTION.name,
        joint=joint,
        members=tuple(member(shape) for shape in [*linear, *felt]),
        parameters=parameters,
        refine={
            "stiffness": stiffnesses,
            "damping_ratio": (LEAST_RATIO, LARGEST_RATIO),
            "doubling_windup": DOUBLING,
        },
        member=member,
        richer=hardly_hardening,
    )


def _stiffness(shape: float, coefficient: float, covariance: Array) -> Quantity:
    """Stiffness with its first-order standard deviation.

    shape: of the column, N·m/rad. covariance: of its coefficient and then of the shapes. A spring's own
    coefficient is 1. As far as a resonance determines the stiffness it is that of the column, as far as slow
    motion does it is that over the coefficient: their joint covariance decides between the two.
    """
    share = max(coefficient, LEAST_SHARE)
    varies, together = max(float(covariance[0, 0]), 0.0), 1.0
    left = varies * (shape / share) ** 2
    if varies > 0.0 and covariance[1, 1] > 0.0:
        slope = float(covariance[0, 1]) / varies
        together = min(max(slope * share / shape, 0.0), 1.0)
        left = max(float(covariance[1, 1]) - slope**2 * varies, 0.0)
    stiffness = shape * share**-together
    return Quantity(stiffness, stiffness / shape * float(np.sqrt(left)), "N·m/rad")


def write(spec: Any, robot: Robot, injection: Injection) -> tuple[str, ...]:
    """A second joint about the same axis, a spring; the first keeps rotor, friction and motor."""
    joint = require_joint(DESCRIPTION.name, injection.joint, robot.joints)
    if injection.law == QUASI_STATIC:
        return ("MuJoCo's joint sensors cannot read a windup that moves no mass",)
    stiffness = injection.values["stiffness"]
    if np.isinf(stiffness):
        return ()
    link = add_link_joint(spec, robot, joint, "elasticity")
    link.stiffness = [stiffness, 0.0, stiffness * _hardening(injection)]
    link.damping = [injection.values["damping"], 0.0, 0.0]
    return ()


def add_link_joint(spec: Any, robot: Robot, joint: int, name: str) -> Any:
    """A joint (MjsJoint) on the body and axis of a robot's joint, where the link leaves the motor."""
    motor = joint_element(spec, robot, joint)
    followers = robot.chain.link_names[robot.joints :]
    index = [each.name for each in spec.joints if each.name not in followers].index(motor.name)
    for numeric in spec.numerics:
        # One value a joint, which load_robot checks.
        if numeric.name in PER_JOINT_NUMERICS:
            limits = list(numeric.data)
            numeric.data = limits[: index + 1] + limits[index:]
            numeric.size = len(limits) + 1
    for other in motor.parent.joints[1:]:
        if other.name.startswith(motor.name) and other.armature == 0.0:
            # Two joints in a row without a mass between them have no inertia matrix.
            other.armature = BETWEEN * float(robot.parameters[PER_JOINT * joint + ARMATURE])
    slide = bool(robot.chain.is_slide[joint])
    kind = mujoco.mjtJoint.mjJNT_SLIDE if slide else mujoco.mjtJoint.mjJNT_HINGE
    link = motor.parent.add_joint(name=f"{motor.name}_{name}", type=kind, pos=motor.pos, axis=motor.axis)
    # Defaults of the model's joints are not meant for this one.
    link.stiffness, link.damping = [0.0] * 3, [0.0] * 3
    link.armature = link.frictionloss = 0.0
    link.limited = mujoco.mjtLimited.mjLIMITED_FALSE
    link.actfrclimited = mujoco.mjtLimited.mjLIMITED_FALSE
    return link
