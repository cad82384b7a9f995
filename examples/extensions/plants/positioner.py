"""A positioner of two crossed axes under PD control with gravity compensation, at 1 kHz.

Friction is a steep tanh of the speed; steps of a control period are semi-implicit Euler.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from testbench.log import Recording

from .drawing import UNKNOWN, Place, log_of
from .links import Links, dynamics, solve, upright
from .motions import Motion, waves

Array = NDArray[np.float64]

STEP = 1e-3  # s
WIDTH = 0.03  # rad/s, of the tanh


@dataclass(frozen=True)
class Positioner:
    """links: with payload. sheet: of the data sheet. All else (2,): shares of Coulomb friction, and noise.

    uneven: by which friction is more in one direction. ripple: of the gear. rough: that the pose changes.
    """

    links: Links
    sheet: Links
    uneven: Array
    ripple: Array
    rough: Array
    noise: float


class PositionerPlant:
    """Draws and runs such robots."""

    name = "positioner"

    def robot(self, rng: np.random.Generator) -> Positioner:
        """A healthy robot of some 10 kg."""
        size = rng.uniform(0.8, 1.3)
        links = upright("zy", size * np.array([0.2, 0.3]), np.array([6.0, 4.0]), np.array([0.3, 0.2]), rng)
        torque = np.array([60.0, 60.0])
        coulomb = torque * rng.uniform(0.03, 0.06, 2)
        links = replace(
            links,
            torque=torque,
            speed=np.full(2, 3.0),
            lower=np.full(2, -1.5),
            upper=np.full(2, 1.5),
            viscous=rng.uniform(1.0, 3.0, 2),
            coulomb=coulomb,
        )
        uneven, ripple = rng.normal(0, 0.03, 2), rng.uniform(0.01, 0.04, 2)
        return Positioner(links, links, uneven, ripple, np.zeros(2), rng.uniform(0.002, 0.006))

    def ideal(self, robot: Positioner) -> Positioner:
        """Viscous friction alone."""
        links = replace(robot.sheet, coulomb=np.zeros(2))
        return replace(robot, links=links, sheet=links)

    def places(self, robot: Positioner) -> tuple[Place, ...]:
        """Faults that it may have."""
        known = [Place(e, j) for e in ("asymmetric_friction", "transmission_ripple") for j in range(2)]
        rough = [Place(UNKNOWN, j, None, "friction that the pose changes") for j in range(2)]
        return (*known, Place("payload"), *rough)

    def faulty(self, robot: Positioner, place: Place, size: float, rng: np.random.Generator) -> Positioner:
        """The robot with one of them."""
        if place.effect == "payload":
            return replace(robot, links=robot.links.carrying(1.5 * size, np.array([0.05, 0.0, 0.2])))
        at = np.arange(2) == place.joint
        if place.effect == "asymmetric_friction":
            return replace(robot, uneven=robot.uneven + 0.3 * size * at)
        if place.effect == "transmission_ripple":
            return replace(robot, ripple=robot.ripple + 0.4 * size * at)
        return replace(robot, rough=robot.rough + 0.8 * size * at)

    def links(self, robot: Positioner) -> Links:
        """Of the data sheet."""
        return robot.sheet

    def motion(self, robot: Positioner, rng: np.random.Generator) -> Motion:
        """Sines, 8 s."""
        sheet = robot.sheet
        return waves(rng, sheet.lower, sheet.upper, 0.8 * sheet.speed, 8.0, 1 / STEP)

    def run(self, robot: Positioner, motion: Motion, rng: np.random.Generator | None) -> Recording:
        """The torque logged is the mean over the control period around each sample."""
        links, (reference, speed, _) = robot.links, motion
        n, kp, kd = links.joints, 60.0 * links.torque, 2.0 * links.torque
        position, torque = np.empty_like(reference), np.empty_like(reference)
        matrix, bias, work = np.zeros((n, n)), np.zeros(n), np.zeros((8, n + 2, 3))
        q, v, a, before = reference[0].copy(), np.zeros(n), np.zeros(n), np.zeros(n)
        for k in range(len(reference)):
            dynamics(*links.body, q, v, matrix, bias, work)
            command = bias + kp * (reference[k] - q) + kd * (speed[k] - v)
            position[k], torque[k] = q, (command + before) / 2 if k else command
            level = 1.0 + robot.rough * np.sin(2.5 * q) ** 2 + robot.ripple * np.sin(20 * q)
            friction = links.viscous * v + links.coulomb * (level * np.tanh(v / WIDTH) + robot.uneven)
            solve(matrix, command - friction - bias, a)
            v, before = v + STEP * a, command
            q = q + STEP * v
        if rng is not None:
            torque = torque + robot.noise * links.torque * rng.standard_normal(torque.shape)
        return log_of(self.name, robot.sheet, 1 / STEP, position, torque, motion)


PLANT = PositionerPlant()
