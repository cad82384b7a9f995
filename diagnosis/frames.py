"""Frames of a model that are not the robot's: which way is down, where a joint's zero is, how it turns.

An arm that hangs from a ceiling and is modelled as on a floor, a drive that reports its torque less what
holds the arm up, a zero or an axis of another convention: each is as large as the torque itself, and nothing
that is linear near the model explains it. By the model's masses, gravity of three components, one angle or
the signs of some joints must explain nearly all. A first joint's zero and the mounting turned about its axis
are the same; so is a joint that nothing loads, whichever way it turns.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from identification.inverse_dynamics import inverse_dynamics
from testbench.robot import Robot

from .link_torque import LinkTorque
from .preparation import Prepared

Array = NDArray[np.float64]

# Of a joint's torque, RMS: what a model leaves that is worth looking at, at two joints. And how much of its
# square must go, of all joints together and of these two: a cable or a payload may look like either at one.
LEFT, EXPLAINED, EXPLAINED_THERE = 0.15, 0.9, 0.75
# Of gravity: a torque with less has none; with another mounting it is as much, as masses are roughly right.
NO_GRAVITY, AS_MUCH = 0.25, (0.6, 1.6)
# rad: gravity that is turned by more is another mounting's, and a zero that is farther off is no encoder's.
TURNED, ELSEWHERE = np.deg2rad(20), np.deg2rad(4)
# rad, between angles that are tried.
STEP = np.deg2rad(10)
# Of what is left: a joint that turns the other way explains this share.
TURNS = 0.2
# Singular values below this share of the largest tell nothing of gravity.
TELLS = 1e-3


@dataclass(frozen=True)
class Misplaced:
    """What explains nearly all that a model leaves.

    zero: a joint, and by how much its position is larger in the logs than in the model, rad; or None.
    gravity: (3,) m/s² as the robot feels it. turned: joints whose position and torque grow the other way.
    """

    gravity: Array
    zero: tuple[int, float] | None = None
    turned: tuple[int, ...] = ()


def misplaced(prepared: Prepared) -> Misplaced | None:
    """The frame that is not the robot's; None where the model stands as the robot does, or nothing tells."""
    seen = LinkTorque(prepared)
    before = seen.left(seen.torque - seen.model(seen.q))
    if np.sum(before > LEFT**2) < 2:
        return None
    down = prepared.robot.chain.gravity
    gravity, felt = _gravity(seen)
    joint, angle, zeroed = _zero(seen)
    turned, signed = _turned(seen)
    found = [
        (Misplaced(gravity), felt, _is_elsewhere(down, gravity)),
        (Misplaced(down, (joint, angle)), zeroed, abs(angle) > ELSEWHERE),
        (Misplaced(down, turned=turned), signed, len(turned) > 0),
    ]
    explaining = [(each, after) for each, after, is_one in found if is_one and _explains(before, after)]
    return min(explaining, key=lambda each: float(each[1].sum()))[0] if explaining else None


def _is_elsewhere(down: Array, gravity: Array) -> bool:
    """Whether gravity (3,) m/s² is next to none, or another mounting's than the model's (3,)."""
    weight, felt = float(np.linalg.norm(down)), float(np.linalg.norm(gravity))
    if weight == 0:
        return False
    turned = float(np.arccos(np.clip(gravity @ down / max(felt * weight, 1e-12), -1, 1)))
    as_much = AS_MUCH[0] * weight < felt < AS_MUCH[1] * weight
    return felt < NO_GRAVITY * weight or (as_much and turned > TURNED)


def _explains(before: Array, after: Array) -> bool:
    """Whether nearly all goes, at two joints at least. before, after: (n,) squared shares of their torque."""
    there = (before > LEFT**2) & (after < (1 - EXPLAINED_THERE) * before)
    return bool(np.sum(there) >= 2 and after.sum() < (1 - EXPLAINED) * before.sum())


def in_words(robot: Robot, found: Misplaced) -> str:
    """That in a sentence, and what to do."""
    if found.zero is not None:
        joint, angle = found.zero
        far = f"{np.rad2deg(angle):.3g}° from where the model has it"
        told = f"The logs have {robot.joint_names[joint]} {far}: is its zero the model's?"
    elif found.turned:
        joints = ", ".join(robot.joint_names[joint] for joint in found.turned)
        turn, axis = ("turns", "its axis") if len(found.turned) == 1 else ("turn", "each axis")
        told = f"By the logs {joints} {turn} the other way than in the model: is {axis} the model's?"
    elif np.linalg.norm(found.gravity) < NO_GRAVITY * np.linalg.norm(robot.chain.gravity):
        told = "The logged torque has no gravity in it, and the model has: was it logged after compensation?"
    else:
        # Not -0.0.
        down = ", ".join(f"{value:.1f}" for value in np.round(found.gravity, 1) + 0.0)
        told = f"The robot feels gravity as ({down}) m/s², and not as in the model: is it mounted so?"
    return f"{told} Mend that first: beside it nothing else is told."


def _gravity(seen: LinkTorque) -> tuple[Array, Array]:
    """Gravity (3,) m/s² that explains most, as near to the model's as can be; what it leaves, (n,)."""
    still = np.zeros_like(seen.q)
    weights = [
        inverse_dynamics(replace(seen.chain, gravity=axis), seen.links, seen.q, still, still)
        for axis in np.eye(3)
    ]
    x = np.column_stack([np.concatenate(seen.projected(weight)) for weight in weights])
    gap = seen.torque - seen.model(seen.q)
    more = np.linalg.lstsq(x, np.concatenate(seen.projected(gap)), rcond=TELLS)[0]
    after = seen.left(gap - np.tensordot(more, np.array(weights), axes=1))
    return seen.chain.gravity + more, after


def _zero(seen: LinkTorque) -> tuple[int, float, Array]:
    """The hinge and the angle, rad, that explain most, taken off its positions; what they leave, (n,)."""
    best = (0, 0.0, np.full(seen.chain.joints, np.inf))
    for joint in np.flatnonzero(~seen.chain.is_slide).tolist():
        axis = np.eye(seen.chain.joints)[joint]

        def left(angle: float, axis: Array = axis) -> Array:
            return seen.left(seen.torque - seen.model(seen.q - angle * axis))

        nearest = min(np.arange(-np.pi, np.pi, STEP).tolist(), key=lambda angle: left(angle).sum())
        found = minimize_scalar(
            lambda angle: left(angle).sum(),
            bounds=(nearest - STEP, nearest + STEP),
            method="bounded",
            options={"xatol": 1e-4},
        )
        if found.fun < best[2].sum():
            best = (joint, float(found.x), left(float(found.x)))
    return best


def _turned(seen: LinkTorque) -> tuple[tuple[int, ...], Array]:
    """The joints that explain most if they turn the other way, one at a time; what they leave, (n,)."""
    sign = np.ones(seen.chain.joints)
    after = _left_turned(seen, sign)
    while True:
        flips = [np.where(np.arange(len(sign)) == joint, -sign, sign) for joint in range(len(sign))]
        best = min(flips, key=lambda each: _left_turned(seen, each).sum())
        left = _left_turned(seen, best)
        if left.sum() > (1 - TURNS) * after.sum():
            return tuple(np.flatnonzero(sign < 0).tolist()), after
        sign, after = best, left


def _left_turned(seen: LinkTorque, sign: Array) -> Array:
    """What is left, (n,), if joints turn by these signs (n,) of the model's."""
    motion = (sign * each for each in (seen.q, seen.dq, seen.ddq))
    return seen.left(seen.torque - sign * inverse_dynamics(seen.chain, seen.links, *motion))
