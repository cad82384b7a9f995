"""A SCARA in closed form: two parallel axes, a quill and a spindle, under computed torque at 2 kHz.

Friction is a smooth tanh of the speed at the end of each step, solved for by Newton's method, so that
steps of
0.5 ms stay stable however steep it is (backward Euler).
"""

from dataclasses import dataclass, replace

import numpy as np
from numba import njit
from numpy.typing import NDArray

from testbench.log import Recording

from .drawing import UNKNOWN, Place, log_of
from .links import GRAVITY, Links, solve
from .motions import Motion, moves, waves

Array = NDArray[np.float64]

RATE = 2000.0
NEWTON = 3
LATEST = 64  # periods that a delay may last
SMOOTH = np.array([0.004, 0.004, 0.001, 0.01])  # rad/s (m/s), width of the tanh

# Columns of the joints' figures.
(
    FV,
    FC,
    EXTRA,
    VELOCITY,
    OFFSET,
    DIFFERENCE,
    BEND,
    RIPPLE,
    CYCLES,
    PHASE,
    CABLE,
    REST,
    GAIN,
    DELAY,
    LIMIT,
    DROP,
    WARMING,
    FRICTION_POWER,
    PUSH,
    PUSH_START,
    PUSH_LENGTH,
    PAIR_VISCOUS,
    PAIR_COULOMB,
    CROSS,
    BUMP,
    BUMP_AT,
    BUMP_WIDTH,
) = range(27)
COLUMNS = 27


@dataclass(frozen=True)
class Scara:
    """figures: l1, c1, l2, c2 (m), m1, m2, m34 (kg), I1, I2, I4 (kg·m²) and 4 rotors. gravity: (3,) m/s².

    sheet: links of the data sheet. table: (4, COLUMNS).
    """

    figures: Array
    gravity: Array
    sheet: Links
    table: Array
    noise: float
    quick: bool


class ScaraPlant:
    """Draws and runs such robots."""

    name = "scara"

    def robot(self, rng: np.random.Generator) -> Scara:
        """A healthy robot with a reach of 0.4 to 0.9 m."""
        size = rng.uniform(0.7, 1.3)
        l1, l2 = size * np.array([0.33, 0.3]) * rng.uniform(0.85, 1.15, 2)
        c1, c2 = l1 * rng.uniform(0.35, 0.6), l2 * rng.uniform(0.3, 0.6)
        m1, m2 = size**2 * np.array([9.0, 6.5]) * rng.uniform(0.8, 1.2, 2)
        m3, m4 = 0.6 * size**2, 0.7 * size**2
        i1, i2 = m1 * l1**2 / 10, m2 * l2**2 / 10
        i4 = m4 * 0.03**2
        rotor = size**4 * np.array([0.7, 0.25, 4.0, 0.004]) * rng.uniform(0.8, 1.3, 4)
        torque = size**3 * np.array([140.0, 60.0, 250.0, 6.0])
        speed = np.array([6.0, 7.0, 1.0, 15.0])
        coulomb = torque * rng.uniform(0.02, 0.06, 4)
        viscous = coulomb / speed * rng.uniform(0.5, 2.5, 4)
        inertia = np.zeros((4, 3, 3))
        for j, own in enumerate((i1, i2, m3 * 0.02**2, i4)):
            inertia[j] = own * np.diag([0.8, 0.8, 1.0])
        sheet = Links(
            place=np.array([[0, 0, 0.2], [l1, 0, 0.05], [l2, 0, 0.0], [0, 0, -0.15]]),
            axis=np.tile([0.0, 0, 1], (4, 1)),
            slide=np.array([False, False, True, False]),
            mass=np.array([m1, m2, m3, m4]),
            centre=np.array([[c1, 0, 0], [c2, 0, 0.05], [0, 0, -0.05], [0, 0, -0.02]]),
            inertia=inertia,
            armature=rotor,
            gravity=np.array([0, 0, -GRAVITY]),
            lower=np.array([-2.2, -2.4, -0.18, -3.0]),
            upper=np.array([2.2, 2.4, 0.0, 3.0]),
            speed=speed,
            torque=torque,
            viscous=viscous,
            coulomb=coulomb,
        )
        figures = np.array([l1, c1, l2, c2, m1, m2, m3 + m4, i1, i2, i4 + m3 * 0.02**2, i4, *rotor])
        table = np.zeros((4, COLUMNS))
        table[:, FV], table[:, FC] = viscous, coulomb
        table[:, EXTRA], table[:, VELOCITY] = (
            coulomb * rng.uniform(0.02, 0.1, 4),
            0.03 * speed * rng.uniform(0.4, 1, 4),
        )
        table[:, OFFSET], table[:, DIFFERENCE] = (
            coulomb * rng.normal(0, 0.03, 4),
            viscous * rng.normal(0, 0.03, 4),
        )
        table[:, RIPPLE], table[:, PHASE] = coulomb * rng.uniform(0.01, 0.05, 4), rng.uniform(0, 6.28, 4)
        # The quill's ripple is that of its screw.
        table[:, CYCLES] = np.where(sheet.slide, 2 * np.pi / 0.02, rng.integers(4, 50, 4))
        table[:, GAIN], table[:, LIMIT] = rng.normal(0, 0.004, 4), 1e9
        table[:, WARMING] = table[:, FRICTION_POWER] = table[:, BUMP_WIDTH] = 1.0
        return Scara(
            figures, sheet.gravity, sheet, table, rng.uniform(0.002, 0.008), bool(rng.random() < 0.5)
        )

    def ideal(self, robot: Scara) -> Scara:
        """Viscous friction alone."""
        table = robot.table.copy()
        table[:, [FC, EXTRA, OFFSET, DIFFERENCE, RIPPLE, GAIN]] = 0.0
        return replace(robot, table=table, sheet=replace(robot.sheet, coulomb=np.zeros(4)))

    def places(self, robot: Scara) -> tuple[Place, ...]:
        """Effects that a SCARA can have, with joints: its first axes are upright, without gravity torque."""
        of_joints = (
            "stribeck_friction",
            "asymmetric_friction",
            "nonlinear_viscous_friction",
            "thermal_friction_drift",
            "transmission_ripple",
            "cable_spring",
            "torque_gain_error",
            "torque_saturation",
            "external_contact",
        )
        places = [Place(effect, joint) for effect in of_joints for joint in range(4)]
        places += [Place("joint_coupling", 0, 1), Place("payload"), Place("base_tilt"), Place("torque_delay")]
        crossed = [Place(UNKNOWN, joint, None, "drag by another joint's speed") for joint in (0, 1, 3)]
        rough = [Place(UNKNOWN, joint, None, "a rough place that rubs") for joint in range(4)]
        return (*places, *crossed, *rough)

    def faulty(self, robot: Scara, place: Place, size: float, rng: np.random.Generator) -> Scara:
        """The robot with one of them."""
        sign = rng.choice([-1, 1])
        if place.effect == "payload":
            figures = robot.figures.copy()
            figures[6] += 1.5 * size
            return replace(robot, figures=figures)
        if place.effect == "base_tilt":
            roll, pitch = 0.02 * size * rng.uniform(0.4, 1, 2) * rng.choice([-1, 1], 2)
            return replace(robot, gravity=robot.sheet.tilted(roll, pitch).gravity)
        table = robot.table.copy()
        if place.effect == "torque_delay":
            table[:, DELAY] = min(0.003 * size, (LATEST - 2) / RATE)
            return replace(robot, table=table)
        assert place.joint is not None
        row, links = table[place.joint], robot.sheet
        fc, fv, limit = row[FC], row[FV], links.torque[place.joint]
        speed, reach = links.speed[place.joint], links.upper[place.joint] - links.lower[place.joint]
        match place.effect:
            case "stribeck_friction":
                row[EXTRA] += 0.6 * fc * size
                row[VELOCITY] = 0.04 * speed * rng.uniform(0.5, 1.5)
            case "asymmetric_friction":
                row[OFFSET] += sign * 0.25 * fc * size
                row[DIFFERENCE] += rng.choice([-1, 1]) * 0.15 * fv * size
            case "nonlinear_viscous_friction":
                row[BEND] = 0.5 * (fc + fv * speed) * size / speed**2
            case "thermal_friction_drift":
                row[DROP], row[WARMING] = min(0.4 * size, 0.9), rng.uniform(4, 20)
                row[FRICTION_POWER] = 0.3 * fc * speed
            case "transmission_ripple":
                row[RIPPLE] = 0.35 * fc * size
            case "cable_spring":
                row[CABLE], row[REST] = fc * size / reach, reach * rng.uniform(-0.1, 0.2)
            case "torque_gain_error":
                row[GAIN] += sign * min(0.08 * size, 0.45)
            case "torque_saturation":
                row[LIMIT] = 0.3 * limit / size
            case "external_contact":
                row[PUSH] = sign * 0.25 * limit * size
                row[PUSH_START], row[PUSH_LENGTH] = rng.uniform(2, 6), rng.uniform(0.3, 1)
            case "joint_coupling":
                row[PAIR_VISCOUS], row[PAIR_COULOMB] = 0.4 * fv * size, 0.4 * fc * size
            case _ if "another" in place.law:
                row[CROSS] = 0.5 * fc * size
            case _:
                row[BUMP], row[BUMP_WIDTH] = 1.2 * fc * size, reach * rng.uniform(0.04, 0.1)
                row[BUMP_AT] = links.lower[place.joint] + reach * rng.uniform(0.35, 0.65)
        return replace(robot, table=table)

    def links(self, robot: Scara) -> Links:
        """Of the data sheet."""
        return robot.sheet

    def motion(self, robot: Scara, rng: np.random.Generator) -> Motion:
        """Sines or moves from place to place, 8 s."""
        sheet = robot.sheet
        if robot.quick:
            return moves(rng, 0.8 * sheet.lower, 0.8 * sheet.upper, 0.4 * sheet.speed, 8.0, RATE)
        return waves(rng, sheet.lower, sheet.upper, 0.7 * sheet.speed, 8.0, RATE, 6, 0.2)

    def run(self, robot: Scara, motion: Motion, rng: np.random.Generator | None) -> Recording:
        """The controller knows the links of the data sheet, and their friction."""
        quantum = 0.0 if rng is None else 2 * np.pi / 2.0**20
        known = _figures(robot.sheet)
        position, torque = _run(
            robot.figures, known, robot.gravity, robot.table, robot.sheet.torque, *motion, SMOOTH, quantum
        )
        if rng is not None:
            torque = torque + robot.noise * robot.sheet.torque * rng.standard_normal(torque.shape)
        return log_of(self.name, robot.sheet, RATE, position, torque, motion)


def _figures(links: Links) -> Array:
    """The figures that links (4,) have."""
    m, c, i = links.mass, links.centre, links.inertia[:, 2, 2]
    lengths = [links.place[1, 0], c[0, 0], links.place[2, 0], c[1, 0]]
    return np.array([*lengths, m[0], m[1], m[2] + m[3], i[0], i[1], i[2] + i[3], i[3], *links.armature])


@njit(cache=True)
def _rigid(f: Array, gravity: Array, q: Array, v: Array, matrix: Array, bias: Array) -> None:
    l1, c1, l2, c2, m1, m2, m = f[0], f[1], f[2], f[3], f[4], f[5], f[6]
    cosine, sine = np.cos(q[1]), np.sin(q[1])
    own = f[8] + m2 * c2**2 + m * l2**2 + f[9]
    bent = (m2 * c2 + m * l2) * l1
    matrix[:] = 0.0
    matrix[0, 0] = f[7] + m1 * c1**2 + (m2 + m) * l1**2 + own + 2 * bent * cosine + f[11]
    matrix[0, 1] = matrix[1, 0] = own + bent * cosine
    matrix[1, 1] = own + f[12]
    matrix[2, 2] = m + f[13]
    matrix[0, 3] = matrix[3, 0] = matrix[1, 3] = matrix[3, 1] = f[10]
    matrix[3, 3] = f[10] + f[14]
    bias[0] = -bent * sine * (2 * v[0] + v[1]) * v[1]
    bias[1] = bent * sine * v[0] ** 2
    bias[2] = -m * gravity[2]
    bias[3] = 0.0
    # Gravity in the plane, where the base is tilted.
    first, second = q[0], q[0] + q[1]
    outer, inner = m2 * c2 + m * l2, m1 * c1 + (m2 + m) * l1
    about = outer * (np.cos(second) * gravity[1] - np.sin(second) * gravity[0])
    bias[0] -= inner * (np.cos(first) * gravity[1] - np.sin(first) * gravity[0]) + about
    bias[1] -= about


@njit(cache=True)
def _run(
    figures: Array,
    known: Array,
    gravity: Array,
    table: Array,
    limit: Array,
    reference: Array,
    speed: Array,
    acceleration: Array,
    smooth: Array,
    quantum: float,
) -> tuple[Array, Array]:
    samples, n = reference.shape
    h = 1.0 / RATE
    position, torque = np.empty((samples, n)), np.empty((samples, n))
    q, v, seen, measured = reference[0].copy(), np.zeros(n), reference[0].copy(), np.zeros(n)
    matrix, bias, net, residual = np.zeros((n, n)), np.zeros(n), np.zeros(n), np.zeros(n)
    level, viscous, warm, given = np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n)
    kept, down = np.zeros((LATEST, n)), np.array([0.0, 0.0, -9.81])
    _rigid(figures, gravity, q, v, matrix, bias)
    command, before = bias.copy(), bias.copy()
    for k in range(LATEST):
        for j in range(bias.size):
            kept[k, j] = bias[j]
    band = 2 * np.pi * 8.0
    for k in range(samples):
        for j in range(n):
            fresh = quantum * np.round(q[j] / quantum) if quantum > 0.0 else q[j]
            if k > 0:
                measured[j] += 0.3 * ((fresh - seen[j]) * RATE - measured[j])
            seen[j] = position[k, j] = fresh
            residual[j] = acceleration[k, j] + 2 * band * (speed[k, j] - measured[j])
            residual[j] += band**2 * (reference[k, j] - fresh)
        _rigid(known, down, seen, measured, matrix, bias)
        for j in range(n):
            before[j] = command[j]
            asked = (
                bias[j] + table[j, FV] * speed[k, j] + table[j, FC] * np.tanh(speed[k, j] / (20 * smooth[j]))
            )
            for i in range(n):
                asked += matrix[j, i] * residual[i]
            command[j] = min(max(asked, -limit[j]), limit[j])
            torque[k, j] = 0.5 * (before[j] + command[j])
            kept[k % LATEST, j] = command[j]
        _rigid(figures, gravity, q, v, matrix, bias)
        time = k * h
        for j in range(n):
            row = table[j]
            whole = int(row[DELAY] / h)
            part = row[DELAY] / h - whole
            given[j] = (1 - part) * kept[(k - whole) % LATEST, j] + part * kept[(k - whole - 1) % LATEST, j]
            given[j] = (1.0 + row[GAIN]) * min(max(given[j], -row[LIMIT]), row[LIMIT])
            level[j] = row[FC] + row[EXTRA] * np.exp(-((v[j] / row[VELOCITY]) ** 2))
            level[j] += row[BUMP] * np.exp(-(((q[j] - row[BUMP_AT]) / row[BUMP_WIDTH]) ** 2))
            viscous[j] = row[FV] * (1.0 - row[DROP] * warm[j])
            power = (level[j] + viscous[j] * abs(v[j])) * abs(v[j])
            warm[j] += h * (power / row[FRICTION_POWER] - warm[j]) / row[WARMING]
            net[j] = (
                given[j] - bias[j] - row[OFFSET] - row[DIFFERENCE] * abs(v[j]) - row[BEND] * v[j] * abs(v[j])
            )
            net[j] += row[RIPPLE] * np.sin(row[CYCLES] * q[j] + row[PHASE]) - row[CABLE] * (q[j] - row[REST])
            net[j] -= row[CROSS] * v[(j + 1) % 2] * abs(v[(j + 1) % 2]) / 4.0
            if row[PUSH_LENGTH] > 0.0 and 0.0 < time - row[PUSH_START] < row[PUSH_LENGTH]:
                net[j] += row[PUSH] * np.sin(np.pi * (time - row[PUSH_START]) / row[PUSH_LENGTH]) ** 2
        both = v[0] + v[1]
        shared = table[0, PAIR_VISCOUS] * both + table[0, PAIR_COULOMB] * np.tanh(both / 0.02)
        net[0] -= shared
        net[1] -= shared
        after, change = v.copy(), np.zeros(n)
        for _ in range(NEWTON):
            jacobian = matrix / h
            for j in range(n):
                slip = np.tanh(after[j] / smooth[j])
                residual[j] = net[j] - level[j] * slip - viscous[j] * after[j]
                for i in range(n):
                    residual[j] -= matrix[j, i] * (after[i] - v[i]) / h
                jacobian[j, j] += level[j] * (1.0 - slip**2) / smooth[j] + viscous[j]
            solve(jacobian, residual, change)
            for j in range(n):
                # Beyond the tanh's width Newton would overshoot.
                after[j] += min(max(change[j], -30 * smooth[j]), 30 * smooth[j])
        for j in range(n):
            v[j] = after[j]
            q[j] += h * v[j]
    return position, torque


PLANT = ScaraPlant()
