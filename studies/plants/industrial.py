"""A six-axis industrial arm: cascaded position and velocity loops at 1 kHz, friction that sticks and slips.

Explicit steps of 0.5 ms. A joint slower than a threshold sticks while its friction can hold it (Karnopp,
"Computer
simulation of stick-slip friction in mechanical dynamic systems", J. Dyn. Sys. 107, 1985).
"""

from dataclasses import dataclass, replace

import numpy as np
from numba import njit
from numpy.typing import NDArray

from testbench.log import Recording

from .drawing import UNKNOWN, Place, log_of
from .links import Links, dynamics, solve, upright
from .motions import Motion, waves

Array = NDArray[np.float64]

RATE, STEPS = 1000.0, 2
STICKING = 1e-3  # rad/s
POSITION_GAIN = 12.0  # 1/s
VELOCITY_BAND = 60.0  # rad/s
DELAYS = 64  # steps that a delay may last

# Columns of the joints' figures.
(
    FV,
    FC,
    EXTRA,
    VELOCITY,
    EXPONENT,
    OFFSET,
    DIFFERENCE,
    BEND,
    POWER,
    LOAD,
    RIPPLE,
    CYCLES,
    PHASE,
    CABLE,
    REST,
    SPRING,
    SPRING_PHASE,
    GAIN,
    LAG,
    DELAY,
    LIMIT,
    ZERO,
    ECCENTRIC,
    ECCENTRIC_PHASE,
    DROP,
    WARMING,
    FRICTION_POWER,
    PUSH,
    PUSH_START,
    PUSH_LENGTH,
    PAIR,
    PAIR_VISCOUS,
    PAIR_COULOMB,
    DRAG,
    CREEP,
    INERTIA,
) = range(36)
COLUMNS = 36


@dataclass(frozen=True)
class Industrial:
    """links: with payload and tilt.

    sheet: links of the data sheet. table: (n, COLUMNS). bits, noise: of sensors.
    """

    links: Links
    sheet: Links
    table: Array
    bits: int
    noise: float


class IndustrialPlant:
    """Draws and runs such robots."""

    name = "industrial"

    def robot(self, rng: np.random.Generator) -> Industrial:
        """A healthy robot, 15 to 150 kg."""
        size = rng.uniform(0.6, 1.3)
        lengths = size * np.array([0.35, 0.6, 0.35, 0.3, 0.12, 0.1]) * rng.uniform(0.8, 1.2, 6)
        mass = size**3 * np.array([45.0, 30.0, 22.0, 9.0, 3.0, 0.8]) * rng.uniform(0.7, 1.3, 6)
        rotor = size**5 * np.array([9.0, 11.0, 4.0, 0.8, 0.25, 0.1]) * rng.uniform(0.7, 1.3, 6)
        links = upright("zyyxyx", lengths, mass, rotor, rng)
        reach = np.cumsum(lengths[::-1])[::-1]
        weight = np.cumsum(mass[::-1])[::-1]
        torque = np.maximum(6.0 * weight * reach, 12 * rotor) + 20 * size
        coulomb = torque * rng.uniform(0.025, 0.07, 6)
        speed = np.array([3.0, 2.6, 3.0, 5.0, 5.0, 7.0]) / size
        links = replace(
            links,
            torque=torque,
            speed=speed,
            lower=np.array([-2.6, -1.4, -1.2, -3.0, -1.8, -3.0]),
            upper=np.array([2.6, 1.6, 2.2, 3.0, 1.8, 3.0]),
            viscous=coulomb / speed * rng.uniform(0.8, 3, 6),
            coulomb=coulomb,
        )
        table = np.zeros((6, COLUMNS))
        table[:, FV], table[:, FC] = links.viscous, coulomb
        table[:, EXTRA] = coulomb * rng.uniform(0.02, 0.12, 6)
        table[:, VELOCITY], table[:, EXPONENT] = rng.uniform(0.03, 0.2, 6), rng.uniform(0.8, 2, 6)
        table[:, OFFSET] = coulomb * rng.normal(0, 0.04, 6)
        table[:, DIFFERENCE] = links.viscous * rng.normal(0, 0.02, 6)
        table[:, LOAD] = rng.uniform(0.002, 0.015, 6)
        table[:, RIPPLE] = coulomb * rng.uniform(0.01, 0.06, 6)
        table[:, CYCLES], table[:, PHASE] = rng.integers(2, 60, 6), rng.uniform(0, 6.28, 6)
        table[:, ECCENTRIC], table[:, ECCENTRIC_PHASE] = rng.uniform(0, 1e-4, 6), rng.uniform(0, 6.28, 6)
        table[:, GAIN], table[:, LIMIT], table[:, PAIR] = rng.normal(0, 0.004, 6), 1e9, -1
        table[:, POWER], table[:, WARMING], table[:, FRICTION_POWER] = 1.0, 1.0, 1.0
        table[:, INERTIA] = rotor + np.array([1.0, 1.0, 0.4, 0.05, 0.02, 0.005]) * weight * reach**2 / 3
        return Industrial(links, links, table, int(rng.integers(17, 22)), rng.uniform(0.002, 0.01))

    def ideal(self, robot: Industrial) -> Industrial:
        """Viscous friction alone."""
        table = robot.table.copy()
        table[:, FC : GAIN + 1] = 0.0
        table[:, [POWER, VELOCITY, EXPONENT]] = 1.0
        table[:, ECCENTRIC] = 0.0
        still = replace(robot.links, coulomb=np.zeros(6))
        return replace(robot, table=table, links=still, sheet=still)

    def places(self, robot: Industrial) -> tuple[Place, ...]:
        """All of the catalogue that a stiff joint can have."""
        of_joints = (
            "stribeck_friction",
            "asymmetric_friction",
            "nonlinear_viscous_friction",
            "load_dependent_friction",
            "thermal_friction_drift",
            "transmission_ripple",
            "cable_spring",
            "torque_gain_error",
            "actuator_lag",
            "torque_saturation",
            "encoder_offset",
            "encoder_eccentricity",
            "external_contact",
        )
        places = [Place(effect, joint) for effect in of_joints for joint in range(6)]
        places += [Place("gravity_spring", joint) for joint in (1, 2)]
        places += [Place("joint_coupling", joint, joint + 1) for joint in (3, 4)]
        places += [Place(effect) for effect in ("payload", "base_tilt", "torque_delay")]
        return (
            *places,
            *(
                Place(UNKNOWN, joint, None, "friction that another joint's pose changes")
                for joint in (1, 2, 4)
            ),
            *(Place(UNKNOWN, joint, None, "torque that creeps with time") for joint in range(6)),
        )

    def faulty(self, robot: Industrial, place: Place, size: float, rng: np.random.Generator) -> Industrial:
        """The robot with one of them."""
        if place.effect == "payload":
            mass = 0.06 * size * robot.links.mass[2]
            return replace(robot, links=robot.links.carrying(mass, rng.uniform(-0.1, 0.25, 3)))
        if place.effect == "base_tilt":
            roll, pitch = 0.02 * size * rng.uniform(0.4, 1, 2) * rng.choice([-1, 1], 2)
            return replace(robot, links=robot.links.tilted(roll, pitch))
        table = robot.table.copy()
        if place.effect == "torque_delay":
            table[:, DELAY] = min(0.004 * size, (DELAYS - 2) / RATE / STEPS)
            return replace(robot, table=table)
        assert place.joint is not None
        row, links = table[place.joint], robot.sheet
        fc, fv = links.coulomb[place.joint], links.viscous[place.joint]
        speed, limit = 0.3 * links.speed[place.joint], links.torque[place.joint]
        match place.effect:
            case "stribeck_friction":
                row[EXTRA] += 0.6 * fc * size
                row[VELOCITY], row[EXPONENT] = rng.uniform(0.04, 0.25), rng.uniform(1, 2)
            case "asymmetric_friction":
                row[OFFSET] += rng.choice([-1, 1]) * 0.25 * fc * size
                row[DIFFERENCE] += rng.choice([-1, 1]) * 0.15 * fv * size
            case "nonlinear_viscous_friction":
                row[POWER] = rng.choice([0.4, 0.5, 0.6, 2.0])
                row[BEND] = 0.5 * (fc + fv * speed) * size / speed ** row[POWER]
            case "load_dependent_friction":
                row[LOAD] += 0.07 * size
            case "thermal_friction_drift":
                row[DROP], row[WARMING] = min(0.4 * size, 0.9), rng.uniform(4, 20)
                row[FRICTION_POWER] = fc * speed + fv * speed**2
            case "transmission_ripple":
                row[RIPPLE] = 0.3 * fc * size
                row[CYCLES], row[PHASE] = rng.integers(3, 50), rng.uniform(0, 6.28)
            case "cable_spring":
                row[CABLE], row[REST] = 0.4 * fc * size, rng.uniform(0, 0.5)
            case "gravity_spring":
                row[SPRING], row[SPRING_PHASE] = 0.12 * limit * size, rng.uniform(-0.5, 0.5)
            case "torque_gain_error":
                row[GAIN] += rng.choice([-1, 1]) * min(0.08 * size, 0.45)
            case "actuator_lag":
                row[LAG] = 0.006 * size
            case "torque_saturation":
                row[LIMIT] = 0.25 * limit / size
            case "encoder_offset":
                row[ZERO] += rng.choice([-1, 1]) * 0.02 * size
            case "encoder_eccentricity":
                row[ECCENTRIC], row[ECCENTRIC_PHASE] = 0.006 * size, rng.uniform(-3, 3)
            case "external_contact":
                row[PUSH] = rng.choice([-1, 1]) * 0.25 * limit * size
                row[PUSH_START], row[PUSH_LENGTH] = rng.uniform(2, 6), rng.uniform(0.3, 1)
            case "joint_coupling":
                row[PAIR] = place.into
                row[PAIR_VISCOUS], row[PAIR_COULOMB] = 0.4 * fv * size, 0.4 * fc * size
            case _ if "pose" in place.law:
                row[DRAG] = 0.6 * fc * size
            case _:
                row[CREEP] = rng.choice([-1, 1]) * 0.08 * fc * size
        return replace(robot, table=table)

    def links(self, robot: Industrial) -> Links:
        """Of the data sheet."""
        return robot.sheet

    def motion(self, robot: Industrial, rng: np.random.Generator) -> Motion:
        """Sines, 8 to 11 s."""
        sheet = robot.sheet
        return waves(rng, sheet.lower, sheet.upper, sheet.speed, float(rng.uniform(8, 11)), RATE)

    def run(self, robot: Industrial, motion: Motion, rng: np.random.Generator | None) -> Recording:
        """Torque is that of the drives' current, its mean over the period around each sample."""
        quantum = 0.0 if rng is None else 2 * np.pi / 2.0**robot.bits
        position, torque = _run(*robot.links.body, robot.table, robot.sheet.torque, *motion, quantum)
        if rng is not None:
            torque = torque + robot.noise * robot.sheet.torque * rng.standard_normal(torque.shape)
        return log_of(self.name, robot.sheet, RATE, position, torque, motion)


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
    acceleration: Array,
    quantum: float,
) -> tuple[Array, Array]:
    samples, n = reference.shape
    h = 1.0 / (RATE * STEPS)
    position, torque = np.empty((samples, n)), np.empty((samples, n))
    q, v, net, a = reference[0] - table[:, ZERO], np.zeros(n), np.zeros(n), np.zeros(n)
    matrix, bias, work = np.zeros((n, n)), np.zeros(n), np.zeros((8, n + 2, 3))
    kept, current, load, warm = np.zeros((DELAYS, n)), np.zeros(n), np.zeros(n), np.zeros(n)
    command, before, drive = np.zeros(n), np.zeros(n), np.zeros(n)
    # The loop's integrators begin with what holds the arm.
    dynamics(place, axis, slide, mass, centre, inertia, armature, gravity, q, v, matrix, bias, work)
    integral, reading, measured = bias.copy(), reference[0].copy(), np.zeros(n)
    for j in range(n):
        row = table[j]
        integral[j] -= row[SPRING] * np.sin(row[SPRING_PHASE] - q[j]) - row[CABLE] * (q[j] - row[REST])
        kept[:, j] = current[j] = command[j] = before[j] = integral[j]
        load[j] = bias[j]
    step = 0
    for k in range(samples):
        for j in range(n):
            row = table[j]
            seen = q[j] + row[ZERO] + row[ECCENTRIC] * np.sin(q[j] + row[ECCENTRIC_PHASE])
            if quantum > 0.0:
                seen = quantum * np.round(seen / quantum)
            measured[j] = 0.5 * measured[j] + 0.5 * ((seen - reading[j]) * RATE if k > 0 else 0.0)
            reading[j] = position[k, j] = seen
            error = speed[k, j] + POSITION_GAIN * (reference[k, j] - seen) - measured[j]
            gain = VELOCITY_BAND * row[INERTIA]
            before[j] = command[j]
            asked = integral[j] + gain * error + row[INERTIA] * acceleration[k, j]
            command[j] = min(max(asked, -limit[j]), limit[j])
            if command[j] == asked:
                integral[j] += gain * 8.0 * error / RATE
            torque[k, j] = 0.5 * (before[j] + command[j])
        for _ in range(STEPS):
            dynamics(place, axis, slide, mass, centre, inertia, armature, gravity, q, v, matrix, bias, work)
            time = step * h
            for j in range(n):
                row = table[j]
                kept[step % DELAYS, j] = command[j]
                late = row[DELAY] / h
                whole = int(late)
                share = late - whole
                given = (1 - share) * kept[(step - whole) % DELAYS, j]
                given += share * kept[(step - whole - 1) % DELAYS, j]
                current[j] += (given - current[j]) * (1.0 if row[LAG] < h else 1.0 - np.exp(-h / row[LAG]))
                drive[j] = (1.0 + row[GAIN]) * min(max(current[j], -row[LIMIT]), row[LIMIT])
            for j in range(n):
                row = table[j]
                fast, way = abs(v[j]), np.sign(v[j])
                level = row[FC] + row[LOAD] * abs(load[j])
                level += row[EXTRA] * np.exp(-((fast / row[VELOCITY]) ** row[EXPONENT]))
                level += row[DRAG] * (1.0 + np.sin(2.0 * q[(j + 1) % n]))
                viscous = row[FV] * (1.0 - row[DROP] * warm[j])
                smooth = (
                    viscous * v[j]
                    + row[OFFSET]
                    + row[DIFFERENCE] * fast
                    + row[BEND] * fast ** row[POWER] * way
                )
                power = (level + viscous * fast) * fast
                warm[j] += h * (power / row[FRICTION_POWER] - warm[j]) / row[WARMING]
                others = row[RIPPLE] * np.sin(row[CYCLES] * q[j] + row[PHASE])
                others += row[SPRING] * np.sin(row[SPRING_PHASE] - q[j]) - row[CABLE] * (q[j] - row[REST])
                if row[PUSH_LENGTH] > 0.0 and 0.0 < time - row[PUSH_START] < row[PUSH_LENGTH]:
                    others += row[PUSH] * np.sin(np.pi * (time - row[PUSH_START]) / row[PUSH_LENGTH]) ** 2
                others -= row[CREEP] * time
                net[j] = drive[j] + others - smooth - bias[j]
                load[j] = net[j] + bias[j]
                # What holds a joint in this step.
                holding = net[j] + matrix[j, j] * v[j] / h
                if fast < STICKING and abs(holding) < level:
                    net[j] -= holding
                elif fast < STICKING:
                    net[j] -= level * np.sign(holding)
                else:
                    net[j] -= level * way
            for j in range(n):
                if table[j, PAIR] >= 0:
                    i = int(table[j, PAIR])
                    both = v[j] + v[i]
                    shared = table[j, PAIR_VISCOUS] * both + table[j, PAIR_COULOMB] * np.tanh(both / 0.01)
                    net[j] -= shared
                    net[i] -= shared
            solve(matrix, net, a)
            for j in range(n):
                load[j] = 0.9 * load[j] + 0.1 * (load[j] - armature[j] * a[j])
                before_step = v[j]
                v[j] += h * a[j]
                # A joint that friction turns round has come to rest.
                if before_step * v[j] < 0.0 and abs(v[j]) < 10 * STICKING:
                    v[j] = 0.0
                q[j] += h * v[j]
            step += 1
    return position, torque


PLANT = IndustrialPlant()
