"""A hobby arm of four geared servos: 12-bit encoders, proportional position control, logged at 100 Hz.

Friction is four springs in parallel that slip one after another (Maxwell slip; Lampaert, Al-Bender &
Swevers, "A
generalized Maxwell-slip friction model", 2003). Explicit steps of 1 ms; drives are motors at a voltage.
"""

from dataclasses import dataclass, replace

import numpy as np
from numba import njit
from numpy.typing import NDArray

from testbench.log import Recording

from .drawing import UNKNOWN, Place, log_of
from .links import Links, dynamics, solve, upright
from .motions import Motion, moves, waves

Array = NDArray[np.float64]

STEP, PERIOD = 1e-3, 10  # s, steps a sample
COUNTS = 4096  # a turn
# Shares of the friction at which the four springs slip, and their stiffness.
SHARES = np.array([0.4, 0.3, 0.2, 0.1])
STIFF = np.array([0.55, 0.25, 0.15, 0.05])

# Columns of the joints' figures.
(
    FV,
    FC,
    EXTRA,
    VELOCITY,
    BRISTLE,
    OFFSET,
    DIFFERENCE,
    LOAD,
    RIPPLE,
    CYCLES,
    PHASE,
    CABLE,
    REST,
    SPRING,
    SPRING_PHASE,
    GAIN,
    LIMIT,
    ZERO,
    ECCENTRIC,
    ECCENTRIC_PHASE,
    PUSH,
    PUSH_START,
    PUSH_LENGTH,
    SAG,
    DRAG,
    KP,
    KD,
) = range(27)
COLUMNS = 27


@dataclass(frozen=True)
class ServoArm:
    """links: with payload and tilt. sheet: links of the data sheet. table: (4, COLUMNS)."""

    links: Links
    sheet: Links
    table: Array
    noise: float
    steps: bool


class ServoArmPlant:
    """Draws and runs such robots."""

    name = "servo_arm"

    def robot(self, rng: np.random.Generator) -> ServoArm:
        """A healthy robot of about a kilogram."""
        lengths = np.array([0.07, 0.14, 0.13, 0.1]) * rng.uniform(0.8, 1.3, 4)
        mass = np.array([0.25, 0.22, 0.18, 0.15]) * rng.uniform(0.8, 1.4, 4)
        rotor = np.array([0.02, 0.02, 0.015, 0.008]) * rng.uniform(0.7, 1.4, 4)
        links = upright("zyyy", lengths, mass, rotor, rng)
        torque = np.array([3.0, 3.5, 3.0, 1.6]) * rng.uniform(0.9, 1.2, 4)
        coulomb = torque * rng.uniform(0.03, 0.07, 4)
        viscous = rng.uniform(0.05, 0.2, 4)
        links = replace(
            links,
            torque=torque,
            speed=np.full(4, 4.0),
            lower=np.array([-2.2, -1.5, -2.0, -1.8]),
            upper=np.array([2.2, 1.5, 2.0, 1.8]),
            viscous=viscous,
            coulomb=coulomb,
        )
        table = np.zeros((4, COLUMNS))
        table[:, FV], table[:, FC] = viscous, coulomb
        table[:, EXTRA], table[:, VELOCITY] = coulomb * rng.uniform(0.02, 0.12, 4), rng.uniform(0.05, 0.2, 4)
        table[:, BRISTLE] = coulomb * rng.uniform(400, 900, 4)
        table[:, OFFSET], table[:, DIFFERENCE] = (
            coulomb * rng.normal(0, 0.04, 4),
            viscous * rng.normal(0, 0.04, 4),
        )
        table[:, LOAD] = rng.uniform(0.005, 0.02, 4)
        table[:, RIPPLE], table[:, CYCLES] = coulomb * rng.uniform(0.02, 0.06, 4), rng.integers(5, 40, 4)
        table[:, PHASE], table[:, GAIN] = rng.uniform(0, 6.28, 4), rng.normal(0, 0.01, 4)
        table[:, ECCENTRIC], table[:, ECCENTRIC_PHASE] = rng.uniform(0, 3e-4, 4), rng.uniform(0, 6.28, 4)
        table[:, LIMIT] = 1e9
        table[:, KP] = torque * rng.uniform(14, 22, 4)
        table[:, KD] = torque * rng.uniform(0.15, 0.35, 4)
        return ServoArm(links, links, table, rng.uniform(0.003, 0.01), bool(rng.random() < 0.4))

    def ideal(self, robot: ServoArm) -> ServoArm:
        """Viscous friction alone."""
        table = robot.table.copy()
        table[:, [FC, EXTRA, BRISTLE, OFFSET, DIFFERENCE, LOAD, RIPPLE, GAIN, ECCENTRIC]] = 0.0
        sheet = replace(robot.sheet, coulomb=np.zeros(4))
        return replace(robot, table=table, sheet=sheet, links=sheet)

    def places(self, robot: ServoArm) -> tuple[Place, ...]:
        """Effects that a servo with plastic or brass gears can have, and their joints."""
        of_joints = (
            "stribeck_friction",
            "presliding_hysteresis",
            "asymmetric_friction",
            "load_dependent_friction",
            "transmission_ripple",
            "cable_spring",
            "torque_gain_error",
            "torque_saturation",
            "encoder_offset",
            "encoder_eccentricity",
            "external_contact",
        )
        places = [Place(effect, joint) for effect in of_joints for joint in range(4)]
        places += [
            Place("gravity_spring", 1),
            Place("gravity_spring", 2),
            Place("payload"),
            Place("base_tilt"),
        ]
        sag = [Place(UNKNOWN, joint, None, "a drive that tires over the run") for joint in range(4)]
        drag = [Place(UNKNOWN, joint, None, "friction that the pose changes") for joint in range(4)]
        return (*places, *sag, *drag)

    def faulty(self, robot: ServoArm, place: Place, size: float, rng: np.random.Generator) -> ServoArm:
        """The robot with one of them."""
        sign = rng.choice([-1, 1])
        if place.effect == "payload":
            return replace(robot, links=robot.links.carrying(0.08 * size, rng.uniform(-0.02, 0.08, 3)))
        if place.effect == "base_tilt":
            roll, pitch = 0.03 * size * rng.uniform(0.4, 1, 2) * rng.choice([-1, 1], 2)
            return replace(robot, links=robot.links.tilted(roll, pitch))
        assert place.joint is not None
        table = robot.table.copy()
        row, limit = table[place.joint], robot.sheet.torque[place.joint]
        fc, fv = row[FC], row[FV]
        match place.effect:
            case "stribeck_friction":
                row[EXTRA] += 0.6 * fc * size
                row[VELOCITY] = rng.uniform(0.08, 0.3)
            case "presliding_hysteresis":
                row[BRISTLE] = 60 * fc / size
            case "asymmetric_friction":
                row[OFFSET] += sign * 0.25 * fc * size
                row[DIFFERENCE] += rng.choice([-1, 1]) * 0.15 * fv * size
            case "load_dependent_friction":
                row[LOAD] += 0.1 * size
            case "transmission_ripple":
                row[RIPPLE] = 0.4 * fc * size
            case "cable_spring":
                row[CABLE], row[REST] = 0.4 * fc * size, rng.uniform(0, 0.5)
            case "gravity_spring":
                row[SPRING], row[SPRING_PHASE] = 0.08 * limit * size, rng.uniform(-0.5, 0.5)
            case "torque_gain_error":
                row[GAIN] += sign * min(0.1 * size, 0.45)
            case "torque_saturation":
                row[LIMIT] = 0.3 * limit / size
            case "encoder_offset":
                row[ZERO] = sign * 0.04 * size
            case "encoder_eccentricity":
                row[ECCENTRIC], row[ECCENTRIC_PHASE] = 0.01 * size, rng.uniform(-3, 3)
            case "external_contact":
                row[PUSH] = sign * 0.2 * limit * size
                row[PUSH_START], row[PUSH_LENGTH] = rng.uniform(2, 6), rng.uniform(0.3, 1)
            case _ if "tires" in place.law:
                row[SAG] = min(0.2 * size, 0.9)
            case _:
                row[DRAG] = 0.5 * fc * size
        return replace(robot, table=table)

    def links(self, robot: ServoArm) -> Links:
        """Of the data sheet."""
        return robot.sheet

    def motion(self, robot: ServoArm, rng: np.random.Generator) -> Motion:
        """Sines or moves, 12 to 16 s, at 1 kHz."""
        sheet, seconds = robot.sheet, float(rng.integers(12, 17))
        if robot.steps:
            return moves(rng, sheet.lower, sheet.upper, 0.7 * sheet.speed, seconds, 1 / STEP)
        return waves(rng, sheet.lower, sheet.upper, 0.7 * sheet.speed, seconds, 1 / STEP, 7)

    def run(self, robot: ServoArm, motion: Motion, rng: np.random.Generator | None) -> Recording:
        """Torque is that of the servo's current, averaged over the 10 ms around each sample."""
        quantum = 0.0 if rng is None else 2 * np.pi / COUNTS
        position, torque = _run(
            *robot.links.body, robot.table, robot.sheet.torque, *motion[:2], SHARES, STIFF, quantum
        )
        half = PERIOD // 2
        padded = np.pad(torque, ((half, half), (0, 0)), mode="edge")
        total = np.cumsum(np.vstack([np.zeros(torque.shape[1]), padded]), axis=0)
        torque = ((total[PERIOD:] - total[:-PERIOD]) / PERIOD)[: len(position)][::PERIOD]
        if rng is not None:
            torque = torque + robot.noise * robot.sheet.torque * rng.standard_normal(torque.shape)
        reference = motion[0][::PERIOD], motion[1][::PERIOD], motion[2][::PERIOD]
        rate = 1 / (STEP * PERIOD)
        return log_of(self.name, robot.sheet, rate, position[::PERIOD], torque, reference)


@njit(cache=True)
def _run(
    place: Array,
    axis: Array,
    slide: Array,
    mass: Array,
    centre: Array,
    inertia: Array,
    armature: Array,
    gravity: Array,
    table: Array,
    limit: Array,
    reference: Array,
    speed: Array,
    shares: Array,
    stiff: Array,
    quantum: float,
) -> tuple[Array, Array]:
    samples, n = reference.shape
    position, torque = np.empty((samples, n)), np.empty((samples, n))
    matrix, bias, work = np.zeros((n, n)), np.zeros(n), np.zeros((8, n + 2, 3))
    q, v, a, net = reference[0] - table[:, ZERO], np.zeros(n), np.zeros(n), np.zeros(n)
    bend, load, level, before = np.zeros((n, 4)), np.zeros(n), np.zeros(n), np.zeros(n)
    dynamics(place, axis, slide, mass, centre, inertia, armature, gravity, q, v, matrix, bias, work)
    for j in range(n):
        # At rest the springs of the friction hold what they can of the arm.
        before[j] = bias[j]
    sag = bias / table[:, KP]
    for k in range(samples):
        dynamics(place, axis, slide, mass, centre, inertia, armature, gravity, q, v, matrix, bias, work)
        time = k * STEP
        for j in range(n):
            row = table[j]
            seen = q[j] + row[ZERO] + row[ECCENTRIC] * np.sin(q[j] + row[ECCENTRIC_PHASE])
            if quantum > 0.0:
                seen = quantum * np.round(seen / quantum)
            position[k, j] = seen
            asked = row[KP] * (reference[k, j] + sag[j] - seen) + row[KD] * (speed[k, j] - v[j])
            command = min(max(asked, -limit[j]), limit[j])
            torque[k, j] = 0.5 * (before[j] + command)
            before[j] = command
            drive = 1.0 + row[GAIN] - row[SAG] * time / (samples * STEP)
            drive *= min(max(command, -row[LIMIT]), row[LIMIT])
            fast = abs(v[j])
            level[j] = (
                row[FC] + row[LOAD] * abs(load[j]) + row[EXTRA] * np.exp(-((v[j] / row[VELOCITY]) ** 2))
            )
            level[j] += row[DRAG] * (1.0 + np.sin(2.5 * q[j]))
            friction = row[FV] * v[j] + row[OFFSET] + row[DIFFERENCE] * fast
            for i in range(4):
                if row[BRISTLE] > 0.0:
                    spring = row[BRISTLE] * stiff[i]
                    most = level[j] * shares[i] / spring
                    bend[j, i] = min(max(bend[j, i] + v[j] * STEP, -most), most)
                    friction += spring * bend[j, i]
            others = row[RIPPLE] * np.sin(row[CYCLES] * q[j] + row[PHASE]) - row[CABLE] * (q[j] - row[REST])
            others += row[SPRING] * np.sin(row[SPRING_PHASE] - q[j])
            if row[PUSH_LENGTH] > 0.0 and 0.0 < time - row[PUSH_START] < row[PUSH_LENGTH]:
                others += row[PUSH] * np.sin(np.pi * (time - row[PUSH_START]) / row[PUSH_LENGTH]) ** 2
            load[j] = drive - friction
            net[j] = drive + others - friction - bias[j]
        solve(matrix, net, a)
        for j in range(n):
            v[j] += STEP * a[j]
            q[j] += STEP * v[j]
    return position, torque


PLANT = ServoArmPlant()
