"""Joint coupling: a drive shared by two joints loads both with friction on the sum of their speeds."""

from collections.abc import Mapping, Sequence
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from identification.errors import InputError

from ..robot import Robot
from .action import (
    MOTOR_TORQUE,
    TIMESTEP,
    VELOCITY,
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
from .bristle import bristle_step, unit_bristle
from .columns import by_run
from .mjcf_form import joint_element
from .signature import Family, Logged, Member, Quantity

Array = NDArray[np.float64]

DESCRIPTION = EffectDescription(
    name="joint_coupling",
    title="Joint coupling",
    law="viscous·(v_j + v_k) + coulomb·sgn(v_j + v_k) loads both joints; the sign is that of a stiff Dahl "
    "bristle (coulomb); smooth: tanh((v_j + v_k) / width) in its place",
    reference='Gautier & Venture, "Identification of standard dynamic parameters of robots with positive '
    'definite inertia matrix", IROS 2013 (the coupled wrist of the TX-40)',
    scope=Scope.PAIR,
    parameters=(
        EffectParameter("viscous", "N·m·s/rad", 0.0, np.inf, (0.1, 0.8), "viscous"),
        EffectParameter("coulomb", "N·m", 0.0, np.inf, (0.1, 0.8), "coulomb"),
        EffectParameter("width", "rad/s", 1e-4, np.inf, (0.01, 0.01), law="smooth"),
    ),
    laws=("coulomb", "smooth"),
    confused_with=("load_dependent_friction",),
    viscous="viscous",
    sizes=("viscous", "coulomb"),
)

_, SMOOTH = DESCRIPTION.laws

# The shared shaft slides after this much twist, rad.
PRESLIDING = 5e-4
# How far that is searched in logs.
TWISTS = (1e-4, 5e-3)
# rad/s of smooth signs: what is tried first, and how far they are searched.
LIKELY_WIDTHS, WIDTHS = (0.03, 0.1), (0.01, 0.3)


def action(injection: Injection, simulated: SimulatedRobot) -> Action:
    """Friction of the shared drive as a torque on both motors."""
    first, second = _pair(injection.joint, injection.into, simulated.robot.joints)
    values = [injection.values[name] for name in ("viscous", "coulomb")]
    width = injection.values["width"] if injection.law == SMOOTH else 0.0
    return Action((hook(Stage.TORQUE, _shared, first, [*values, second, width], state=1),))


@hook_kernel
def _shared(bus: int, parameters: int, state: int, joint: int) -> None:
    value, deflection = vector(parameters, 4), vector(state, 1)
    row, other = bus_row(bus, joint), bus_row(bus, int(value[2]))
    speed, coulomb = row[VELOCITY] + other[VELOCITY], value[1]
    torque = value[0] * speed
    if value[3] > 0.0:
        torque += coulomb * np.tanh(speed / value[3])
    elif coulomb > 0.0:
        stiffness = coulomb / PRESLIDING
        deflection[0] = bristle_step(deflection[0], speed, coulomb, stiffness, 1.0, row[TIMESTEP])
        torque += stiffness * deflection[0]
    row[MOTOR_TORQUE] -= torque
    other[MOTOR_TORQUE] -= torque


def signature(runs: Sequence[Logged], joint: int | None, into: int | None) -> Family:
    """Speed of the other joint, friction on the summed speed, acceleration of the other joint; on both rows.

    A joint's own speed is in its viscous friction. Friction is Dahl's bristle of a unit of level: where both
    joints all but turn against each other, the sign of a measured speed says little. Or it is a tanh of some
    width, which taken for a sign looks like more viscous friction. The third coefficient is the inertia that
    they share.
    """
    pair = _pair(joint, into, runs[0].joints)

    def member(shape: Mapping[str, float]) -> Member:
        def columns(run: Logged) -> Array:
            v, a = run.dq[:, pair], run.ddq[:, pair]
            friction = _friction(v.sum(axis=1), shape, 1 / run.sample_rate)
            return np.stack([v[:, ::-1], friction.repeat(2, axis=1), a[:, ::-1]], axis=2)

        law, made = SMOOTH if "width" in shape else None, by_run(runs, columns)
        return Member(dict(shape), tuple(pair), made, np.zeros(3), np.full(3, np.inf), law)

    def parameters(member: Member, c: Array, covariance: Array) -> dict[str, Quantity]:
        std = np.sqrt(np.maximum(np.diag(covariance), 0.0))
        found = {
            "viscous": Quantity(float(c[0]), float(std[0]), "N·m·s/rad"),
            "coulomb": Quantity(float(c[1]), float(std[1]), "N·m"),
        }
        if "width" in member.shape:
            # After three coefficients and the twist, which it has not.
            found["width"] = Quantity(member.shape["width"], float(std[4]), "rad/s")
        return found

    return Family(
        DESCRIPTION.name,
        pair[0],
        (member({"twist": PRESLIDING}), *(member({"width": width}) for width in LIKELY_WIDTHS)),
        parameters,
        refine={"twist": TWISTS, "width": WIDTHS},
        member=member,
        into=pair[1],
    )


def _friction(speed: Array, shape: Mapping[str, float], timestep: float) -> Array:
    """A unit of Coulomb friction on a speed (N,), (N, 1)."""
    if "width" in shape:
        return np.tanh(speed / shape["width"])[:, None]
    friction = np.empty((len(speed), 1))
    unit_bristle(speed, np.array([shape["twist"]]), 1.0, timestep, friction)
    return friction


def write(spec: Any, robot: Robot, injection: Injection) -> tuple[str, ...]:
    """A fixed tendon over both joints with damping and frictionloss."""
    first, second = _pair(injection.joint, injection.into, robot.joints)
    names = [joint_element(spec, robot, joint).name for joint in (first, second)]
    tendon = spec.add_tendon(name=f"{names[0]}_{names[1]}_coupling")
    for name in names:
        tendon.wrap_joint(name, 1.0)
    tendon.damping = [injection.values["viscous"], 0.0, 0.0]
    tendon.frictionloss = injection.values["coulomb"]
    tendon.limited = mujoco.mjtLimited.mjLIMITED_FALSE
    if injection.law == SMOOTH:
        return ("MuJoCo's frictionloss jumps where the speeds' sum changes its sign",)
    return ()


def _pair(joint: int | None, into: int | None, joints: int) -> list[int]:
    """Both joints. Raises InputError unless they are two joints of the robot."""
    pair = [require_joint(DESCRIPTION.name, each, joints) for each in (joint, into)]
    if pair[0] == pair[1]:
        raise InputError("effects", DESCRIPTION.name, "two different joints", pair)
    return pair
