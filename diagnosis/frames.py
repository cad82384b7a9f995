"""Frames of a model that are not the robot's: which way is down, and where a joint's zero is.

An arm that hangs from a ceiling and is modelled as on a floor, a drive that reports its torque less what
holds the arm up, a zero of another convention: each is as large as the torque itself, and nothing that is
linear near the model explains it. By the model's masses, gravity of three components or one angle must
explain nearly all. A first joint's zero and the mounting turned about its axis are the same.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from identification.inverse_dynamics import inverse_dynamics
from identification.parameters import without_friction
from testbench.robot import Robot

from .preparation import Prepared

Array = NDArray[np.float64]

# Samples that are looked at, evenly spread over all runs.
MOST = 800
# Of a joint's torque, RMS: what a model leaves that is worth looking at, at two joints. And how much of its
# square must go, of all joints together and of these two: a cable or a payload may look like either at one.
LEFT, EXPLAINED, EXPLAINED_THERE = 0.15, 0.9, 0.75
# Of gravity: a torque with less has none; with another mounting it is as much, as masses are roughly right.
NO_GRAVITY, AS_MUCH = 0.25, (0.6, 1.6)
# rad: gravity that is turned by more is another mounting's, and a zero that is farther off is no encoder's.
TURNED, ELSEWHERE = np.deg2rad(20), np.deg2rad(4)
# rad, between angles that are tried.
STEP = np.deg2rad(10)
# Singular values below this share of the largest tell nothing of gravity.
TELLS = 1e-3


@dataclass(frozen=True)
class Misplaced:
    """What explains nearly all that a model leaves.

    zero: a joint, and by how much its position is larger in the logs than in the model, rad; or None.
    gravity: (3,) m/s² as the robot feels it.
    """

    gravity: Array
    zero: tuple[int, float] | None = None


def misplaced(prepared: Prepared) -> Misplaced | None:
    """The frame that is not the robot's; None where the model stands as the robot does, or nothing tells."""
    seen = _Seen(prepared)
    before = seen.left(seen.torque - seen.model(seen.q))
    if np.sum(before > LEFT**2) < 2:
        return None
    gravity, after = seen.gravity()
    down = prepared.robot.chain.gravity
    weight, felt = float(np.linalg.norm(down)), float(np.linalg.norm(gravity))
    if weight > 0 and _explains(before, after):
        turned = float(np.arccos(np.clip(gravity @ down / max(felt * weight, 1e-12), -1, 1)))
        as_much = AS_MUCH[0] * weight < felt < AS_MUCH[1] * weight
        if felt < NO_GRAVITY * weight or (as_much and turned > TURNED):
            return Misplaced(gravity)
    joint, angle, after = seen.zero()
    if _explains(before, after) and abs(angle) > ELSEWHERE:
        return Misplaced(down, (joint, angle))
    return None


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
    elif np.linalg.norm(found.gravity) < NO_GRAVITY * np.linalg.norm(robot.chain.gravity):
        told = "The logged torque has no gravity in it, and the model has: was it logged after compensation?"
    else:
        # Not -0.0.
        down = ", ".join(f"{value:.1f}" for value in np.round(found.gravity, 1) + 0.0)
        told = f"The robot feels gravity as ({down}) m/s², and not as in the model: is it mounted so?"
    return f"{told} Mend that first: beside it nothing else is told."


class _Seen:
    """Torque and motion of all runs, thinned. Friction, rotor and offset of each joint are projected out."""

    def __init__(self, prepared: Prepared):
        every = -(-sum(len(run.time) for run in prepared.runs) // MOST)
        self.torque, self.q, self.dq, self.ddq, used = (
            np.concatenate([getattr(run, name)[::every] for run in prepared.runs])
            for name in ("torque", "q", "dq", "ddq", "used")
        )
        self.chain = prepared.robot.chain.without_springs()
        self.links = without_friction(prepared.nominal)
        self.bases: list[tuple[Array, NDArray[np.bool_], float]] = []
        for joint, own in enumerate(used.T):
            speed = self.dq[own, joint]
            columns = np.column_stack([speed, np.sign(speed), self.ddq[own, joint], np.ones(own.sum())])
            size = float(np.sqrt(np.sum(self.torque[own, joint] ** 2)))
            if own.sum() > 2 * columns.shape[1] and size > 0:
                self.bases.append((np.linalg.qr(columns)[0], own, size))
            else:
                self.bases.append((columns[:, :0], np.zeros_like(own), 1.0))

    def model(self, q: Array) -> Array:
        """The model's torque (M, n) along the motion from other positions (M, n)."""
        return inverse_dynamics(self.chain, self.links, q, self.dq, self.ddq)

    def projected(self, torque: Array) -> list[Array]:
        """A torque (M, n), a joint each, as a share of its own, without what is projected out."""
        parts = []
        for (basis, own, size), column in zip(self.bases, torque.T, strict=True):
            part = column[own]
            parts.append((part - basis @ (basis.T @ part)) / size)
        return parts

    def left(self, torque: Array) -> Array:
        """Its mean square, (n,)."""
        return np.array([float(part @ part) for part in self.projected(torque)])

    def gravity(self) -> tuple[Array, Array]:
        """Gravity (3,) m/s² that explains most, as near to the model's as can be; what it leaves, (n,)."""
        still = np.zeros_like(self.q)
        weights = [
            inverse_dynamics(replace(self.chain, gravity=axis), self.links, self.q, still, still)
            for axis in np.eye(3)
        ]
        x = np.column_stack([np.concatenate(self.projected(weight)) for weight in weights])
        gap = self.torque - self.model(self.q)
        more = np.linalg.lstsq(x, np.concatenate(self.projected(gap)), rcond=TELLS)[0]
        after = self.left(gap - np.tensordot(more, np.array(weights), axes=1))
        return self.chain.gravity + more, after

    def zero(self) -> tuple[int, float, Array]:
        """The hinge and the angle, rad, that explain most, taken off its positions; what they leave, (n,)."""
        best = (0, 0.0, np.full(self.chain.joints, np.inf))
        for joint in np.flatnonzero(~self.chain.is_slide).tolist():
            axis = np.eye(self.chain.joints)[joint]

            def left(angle: float, axis: Array = axis) -> Array:
                return self.left(self.torque - self.model(self.q - angle * axis))

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
