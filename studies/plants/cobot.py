"""A collaborative arm: motors and links joined by harmonic drives, with bristles for friction.

The motors' friction is that of Canudas de Wit, Olsson, Astrom & Lischinsky, "A new model for control of
systems with
friction", IEEE TAC 40(3), 1995, with its bristles integrated exactly over a step. Steps of 0.25 ms.
"""

from dataclasses import dataclass, replace

import numpy as np
from numba import njit
from numpy.typing import NDArray

from testbench.log import Recording

from .drawing import UNKNOWN, Place, log_of
from .links import Links, dynamics, inverse_along, solve, upright
from .motions import Motion, waves

Array = NDArray[np.float64]

CONTROL, STEPS, LOGGED = 1000.0, 4, 2  # Hz, steps a period, periods a sample
BAND = 30.0  # rad/s
OUTPUT = 0.25  # share of a drive's inertia that turns with the link
LATEST = 64  # steps that a delay may last

# Columns of the joints' figures.
(
    ROTOR,
    STIFFNESS,
    DAMPING,
    GAP,
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
    GAIN,
    LAG,
    DELAY,
    ZERO,
    CABLE,
    REST,
    PUSH,
    PUSH_START,
    PUSH_LENGTH,
    SHAKE,
    SHAKE_RATE,
    STOP,
    STOP_AT,
) = range(28)
COLUMNS = 28


@dataclass(frozen=True)
class Cobot:
    """links: with the drives' output side, payload and tilt. sheet: the data sheet's. table: (n, COLUMNS)."""

    links: Links
    sheet: Links
    table: Array
    noise: float


class CobotPlant:
    """Draws and runs such robots."""

    name = "cobot"

    def robot(self, rng: np.random.Generator) -> Cobot:
        """A healthy robot, 12 to 35 kg."""
        size = rng.uniform(0.7, 1.2)
        lengths = size * np.array([0.15, 0.45, 0.4, 0.12, 0.1, 0.09]) * rng.uniform(0.85, 1.15, 6)
        mass = size**3 * np.array([4.0, 9.0, 4.0, 2.0, 1.8, 0.6]) * rng.uniform(0.8, 1.2, 6)
        rotor = size**5 * np.array([0.9, 0.9, 0.5, 0.15, 0.12, 0.1]) * rng.uniform(0.8, 1.3, 6)
        links = upright("zyyyzy", lengths, mass, rotor, rng)
        reach, weight = np.cumsum(lengths[::-1])[::-1], np.cumsum(mass[::-1])[::-1]
        torque = 9.81 * weight * reach + 14 * size
        coulomb = torque * rng.uniform(0.03, 0.08, 6)
        speed = np.array([2.2, 2.2, 2.8, 3.1, 3.1, 3.1])
        viscous = coulomb / speed * rng.uniform(1, 4, 6)
        links = replace(
            links,
            torque=torque,
            speed=speed,
            lower=np.array([-2.8, -1.9, -2.2, -2.8, -2.8, -2.8]),
            upper=np.array([2.8, 1.9, 2.2, 2.8, 2.8, 2.8]),
            viscous=viscous,
            coulomb=coulomb,
        )
        carried = weight * reach**2 / 3 + 0.01
        table = np.zeros((6, COLUMNS))
        table[:, ROTOR], table[:, FV], table[:, FC] = (1 - OUTPUT) * rotor, viscous, coulomb
        table[:, STIFFNESS] = (2 * np.pi * rng.uniform(25, 45, 6)) ** 2 * carried
        table[:, DAMPING] = table[:, STIFFNESS] * rng.uniform(2e-4, 5e-4, 6)
        table[:, EXTRA], table[:, VELOCITY] = coulomb * rng.uniform(0.02, 0.12, 6), rng.uniform(0.03, 0.2, 6)
        table[:, BRISTLE] = coulomb * rng.uniform(2500, 7000, 6)
        table[:, OFFSET], table[:, DIFFERENCE] = (
            coulomb * rng.normal(0, 0.03, 6),
            viscous * rng.normal(0, 0.03, 6),
        )
        table[:, LOAD] = rng.uniform(0.004, 0.02, 6)
        # A harmonic drive's wave generator turns twice past each tooth.
        table[:, RIPPLE], table[:, CYCLES] = coulomb * rng.uniform(0.01, 0.07, 6), 2 * rng.integers(50, 81, 6)
        table[:, PHASE], table[:, GAIN] = rng.uniform(0, 6.28, 6), rng.normal(0, 0.005, 6)
        table[:, STOP_AT], table[:, SHAKE_RATE] = 9.0, 1.0
        bare = replace(links, armature=OUTPUT * rotor)
        return Cobot(bare, links, table, rng.uniform(0.001, 0.006))

    def ideal(self, robot: Cobot) -> Cobot:
        """Stiff, with viscous friction alone."""
        table = robot.table.copy()
        table[:, [FC, EXTRA, BRISTLE, OFFSET, DIFFERENCE, LOAD, RIPPLE, GAIN]] = 0.0
        table[:, STIFFNESS] *= 4
        sheet = replace(robot.sheet, coulomb=np.zeros(6))
        return replace(robot, table=table, sheet=sheet)

    def places(self, robot: Cobot) -> tuple[Place, ...]:
        """Effects that the drives of such an arm can have, and their joints."""
        of_joints = (
            "joint_elasticity",
            "backlash",
            "presliding_hysteresis",
            "stribeck_friction",
            "asymmetric_friction",
            "load_dependent_friction",
            "transmission_ripple",
            "torque_gain_error",
            "actuator_lag",
            "encoder_offset",
            "cable_spring",
            "external_contact",
        )
        places = [Place(effect, joint) for effect in of_joints for joint in range(6)]
        places += [Place(effect) for effect in ("payload", "base_tilt", "torque_delay")]
        shaken, stopped = "a joint shaken at one frequency", "a soft stop inside the range"
        unknown = [Place(UNKNOWN, joint, None, law) for law in (shaken, stopped) for joint in range(6)]
        return (*places, *unknown)

    def faulty(self, robot: Cobot, place: Place, size: float, rng: np.random.Generator) -> Cobot:
        """The robot with one of them."""
        sign = rng.choice([-1, 1])
        if place.effect == "payload":
            return replace(robot, links=robot.links.carrying(1.5 * size, rng.uniform(-0.08, 0.15, 3)))
        if place.effect == "base_tilt":
            roll, pitch = 0.02 * size * rng.uniform(0.4, 1, 2) * rng.choice([-1, 1], 2)
            return replace(robot, links=robot.links.tilted(roll, pitch))
        table = robot.table.copy()
        if place.effect == "torque_delay":
            table[:, DELAY] = min(0.004 * size, (LATEST - 2) / CONTROL / STEPS)
            return replace(robot, table=table)
        assert place.joint is not None
        row, links = table[place.joint], robot.sheet
        fc, fv, limit = row[FC], row[FV], links.torque[place.joint]
        match place.effect:
            case "joint_elasticity":
                row[STIFFNESS] /= 1 + 6 * size
                row[DAMPING] = row[STIFFNESS] * 2e-3
            case "backlash":
                row[GAP] = 0.002 * size
            case "presliding_hysteresis":
                row[BRISTLE] = 300 * fc / size
            case "stribeck_friction":
                row[EXTRA] += 0.6 * fc * size
                row[VELOCITY] = rng.uniform(0.04, 0.25)
            case "asymmetric_friction":
                row[OFFSET] += sign * 0.25 * fc * size
                row[DIFFERENCE] += rng.choice([-1, 1]) * 0.15 * fv * size
            case "load_dependent_friction":
                row[LOAD] += 0.08 * size
            case "transmission_ripple":
                row[RIPPLE], row[CYCLES] = 0.35 * fc * size, rng.integers(3, 60)
            case "torque_gain_error":
                row[GAIN] += sign * min(0.08 * size, 0.45)
            case "actuator_lag":
                row[LAG] = 0.006 * size
            case "encoder_offset":
                row[ZERO] = sign * 0.02 * size
            case "cable_spring":
                row[CABLE], row[REST] = 0.4 * fc * size, rng.uniform(0, 0.5)
            case "external_contact":
                row[PUSH] = sign * 0.25 * limit * size
                row[PUSH_START], row[PUSH_LENGTH] = rng.uniform(2, 6), rng.uniform(0.3, 1)
            case _ if "shaken" in place.law:
                row[SHAKE], row[SHAKE_RATE] = 0.3 * fc * size, rng.uniform(3, 12)
            case _:
                row[STOP], row[STOP_AT] = 4 * fc * size, rng.uniform(-0.4, 0.2)
        return replace(robot, table=table)

    def links(self, robot: Cobot) -> Links:
        """Of the data sheet."""
        return robot.sheet

    def motion(self, robot: Cobot, rng: np.random.Generator) -> Motion:
        """Sines, 8 to 10 s, at the controller's rate."""
        sheet = robot.sheet
        return waves(rng, sheet.lower, sheet.upper, 0.8 * sheet.speed, float(rng.uniform(8, 10)), CONTROL, 7)

    def run(self, robot: Cobot, motion: Motion, rng: np.random.Generator | None) -> Recording:
        """Positions are the motors'; the controller knows the links without the load."""
        planned = inverse_along(*robot.sheet.body, *motion) + robot.sheet.viscous * motion[1]
        quantum = 0.0 if rng is None else 2 * np.pi / 2.0**19
        n = robot.sheet.joints
        stiff = BAND**2 * (robot.table[:, ROTOR] + robot.table[:, STIFFNESS] / 60000)
        position, torque = _run(
            *robot.links.body, robot.table, robot.sheet.torque, *motion[:2], planned, stiff, quantum
        )
        position, torque = position[::LOGGED], torque[::LOGGED]
        if rng is not None:
            torque = torque + robot.noise * robot.sheet.torque * rng.standard_normal((len(torque), n))
        reference = motion[0][::LOGGED], motion[1][::LOGGED], motion[2][::LOGGED]
        return log_of(self.name, robot.sheet, CONTROL / LOGGED, position, torque, reference)


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
    planned: Array,
    stiff: Array,
    quantum: float,
) -> tuple[Array, Array]:
    samples, n = reference.shape
    h = 1.0 / (CONTROL * STEPS)
    position, torque = np.empty((samples, n)), np.empty((samples, n))
    link, rate, bend = reference[0] - table[:, ZERO], np.zeros(n), np.zeros(n)
    matrix, bias, work = np.zeros((n, n)), np.zeros(n), np.zeros((8, n + 2, 3))
    factor, net, a = np.zeros((n, n)), np.zeros(n), np.zeros(n)
    dynamics(place, axis, slide, mass, centre, inertia, armature, gravity, link, rate, matrix, bias, work)
    motor, spin = np.zeros(n), np.zeros(n)
    command, before, measured = bias.copy(), bias.copy(), np.zeros(n)
    kept, current, reading = np.zeros((LATEST, n)), bias.copy(), np.zeros(n)
    for j in range(n):
        motor[j] = link[j] + bias[j] / table[j, STIFFNESS] + np.sign(bias[j]) * table[j, GAP] / 2
        reading[j] = motor[j] + table[j, ZERO]
        kept[:, j] = bias[j]
    lean = reference[0] - reading
    step = 0
    for k in range(samples):
        for j in range(n):
            row = table[j]
            seen = motor[j] + row[ZERO]
            if quantum > 0.0:
                seen = quantum * np.round(seen / quantum)
            fresh = (seen - reading[j]) * CONTROL if k > 0 else 0.0
            measured[j] += 0.4 * (fresh - measured[j])
            reading[j] = position[k, j] = seen
            before[j] = command[j]
            asked = planned[k, j] + row[FC] * np.tanh(speed[k, j] / 0.05)
            asked += stiff[j] * (reference[k, j] - lean[j] - seen)
            asked += 2 * stiff[j] / BAND * (speed[k, j] - measured[j])
            command[j] = min(max(asked, -limit[j]), limit[j])
            torque[k, j] = 0.5 * (before[j] + command[j])
        for inner in range(STEPS):
            if inner % 2 == 0:
                dynamics(
                    place,
                    axis,
                    slide,
                    mass,
                    centre,
                    inertia,
                    armature,
                    gravity,
                    link,
                    rate,
                    matrix,
                    bias,
                    work,
                )
            time = step * h
            for j in range(n):
                row = table[j]
                kept[step % LATEST, j] = command[j]
                whole = int(row[DELAY] / h)
                part = row[DELAY] / h - whole
                given = (1 - part) * kept[(step - whole) % LATEST, j] + part * kept[
                    (step - whole - 1) % LATEST, j
                ]
                current[j] += (given - current[j]) * (1.0 if row[LAG] < h else h / (row[LAG] + h))
                wind = motor[j] - link[j]
                loose = max(abs(wind) - row[GAP] / 2, 0.0) * np.sign(wind)
                carried = row[STIFFNESS] * loose + (
                    row[DAMPING] * (spin[j] - rate[j]) if loose != 0.0 else 0.0
                )
                if carried * loose < 0.0:
                    carried = 0.0
                level = (
                    row[FC]
                    + row[LOAD] * abs(carried)
                    + row[EXTRA] * np.exp(-((spin[j] / row[VELOCITY]) ** 2))
                )
                if row[BRISTLE] > 0.0:
                    settled = level / row[BRISTLE] * np.sign(spin[j])
                    bend[j] += (settled - bend[j]) * (1.0 - np.exp(-row[BRISTLE] * abs(spin[j]) * h / level))
                friction = (
                    row[BRISTLE] * bend[j] + row[FV] * spin[j] + row[OFFSET] + row[DIFFERENCE] * abs(spin[j])
                )
                others = row[RIPPLE] * np.sin(row[CYCLES] * motor[j] + row[PHASE])
                others += row[SHAKE] * np.sin(2 * np.pi * row[SHAKE_RATE] * time)
                push = (
                    -row[CABLE] * (link[j] - row[REST]) - row[STOP] * max(link[j] - row[STOP_AT], 0.0) ** 1.5
                )
                if row[PUSH_LENGTH] > 0.0 and 0.0 < time - row[PUSH_START] < row[PUSH_LENGTH]:
                    push += row[PUSH] * np.sin(np.pi * (time - row[PUSH_START]) / row[PUSH_LENGTH]) ** 2
                net[j] = carried + push - bias[j]
                drive = (1.0 + row[GAIN]) * current[j]
                spin[j] += h / row[ROTOR] * (drive + others - friction - carried)
            for j in range(n):
                for other in range(n):
                    factor[j, other] = matrix[j, other]
            solve(factor, net, a)
            for j in range(n):
                rate[j] += h * a[j]
                link[j] += h * rate[j]
                motor[j] += h * spin[j]
            step += 1
    return position, torque


PLANT = CobotPlant()
