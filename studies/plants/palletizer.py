"""A heavy five-axis arm close to its path: torque follows from the motion, not the reverse.

The links follow the reference through a stiff servo; motors, gearboxes and friction then say what torque
that took:
q_m = q_l + tau_l / K, tau = I ddq_m + friction(dq_m) + tau_l (flatness; Spong, J. Dyn. Sys. 109, 1987). No
integration, friction a tanh of the speed.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.signal import bilinear, lfilter, lfilter_zi

from testbench.log import Recording

from .drawing import UNKNOWN, Place, log_of
from .links import Links, inverse_along, upright
from .motions import Motion, waves

Array = NDArray[np.float64]

SMOOTH = 0.006  # rad/s, width of the friction's tanh


@dataclass(frozen=True)
class Joint:
    """Figures of a joint, SI; each law is in ``PalletizerPlant.run``."""

    rotor: float
    stiffness: float
    fv: float
    fc: float
    extra: float
    velocity: float
    offset: float
    difference: float
    load: float
    ripple: tuple[float, int, float]
    gain: float
    bend: float = 0.0
    power: float = 1.0
    drop: float = 0.0
    warming: float = 1.0
    spring: tuple[float, float] = (0.0, 0.0)
    cable: tuple[float, float] = (0.0, 0.0)
    lag: float = 0.0
    zero: float = 0.0
    eccentric: tuple[float, float] = (0.0, 0.0)
    push: tuple[float, float, float] = (0.0, 0.0, 1.0)
    commutation: float = 0.0
    dwell: float = 0.0


@dataclass(frozen=True)
class Palletizer:
    """links: without rotors, with payload and tilt. sheet: of the data sheet. joints: figures of each.

    delay: s, of all drives. pairs: (first, second, viscous, Coulomb) of shared drives. band: rad/s, of the
    servo.
    rate: Hz.
    """

    links: Links
    sheet: Links
    joints: tuple[Joint, ...]
    delay: float
    pairs: tuple[tuple[int, int, float, float], ...]
    band: float
    rate: float
    noise: float


class PalletizerPlant:
    """Draws and runs such robots."""

    name = "palletizer"

    def robot(self, rng: np.random.Generator) -> Palletizer:
        """A healthy robot, 200 to 900 kg."""
        size = rng.uniform(0.7, 1.2)
        lengths = size * np.array([0.7, 1.1, 1.0, 0.25, 0.2]) * rng.uniform(0.9, 1.1, 5)
        mass = size**3 * np.array([250.0, 140.0, 90.0, 25.0, 12.0]) * rng.uniform(0.8, 1.2, 5)
        rotor = size**5 * np.array([120.0, 140.0, 90.0, 8.0, 3.0]) * rng.uniform(0.8, 1.2, 5)
        links = upright("zyyyz", lengths, mass, rotor, rng)
        reach, weight = np.cumsum(lengths[::-1])[::-1], np.cumsum(mass[::-1])[::-1]
        torque = np.array([4.0, 14, 14, 14, 14]) * weight * reach
        coulomb = torque * rng.uniform(0.01, 0.03, 5)
        speed = np.array([2.0, 1.9, 1.9, 4.0, 5.0]) / size
        viscous = coulomb / speed * rng.uniform(0.8, 3, 5)
        sheet = replace(
            links,
            torque=torque,
            speed=speed,
            lower=np.array([-2.8, -0.7, 0.3, -1.5, -3.0]),
            upper=np.array([2.8, 1.4, 2.0, 1.5, 3.0]),
            viscous=viscous,
            coulomb=coulomb,
        )
        joints = tuple(
            Joint(
                rotor=rotor[j],
                stiffness=(2 * np.pi * rng.uniform(22, 35)) ** 2 * weight[j] * reach[j] ** 2 / 3,
                fv=viscous[j],
                fc=coulomb[j],
                extra=coulomb[j] * rng.uniform(0.02, 0.12),
                velocity=rng.uniform(0.02, 0.1),
                offset=coulomb[j] * rng.normal(0, 0.04),
                difference=viscous[j] * rng.normal(0, 0.03),
                load=rng.uniform(0.002, 0.01),
                ripple=(coulomb[j] * rng.uniform(0.01, 0.06), int(rng.integers(2, 40)), rng.uniform(0, 6.28)),
                gain=rng.normal(0, 0.004),
                eccentric=(rng.uniform(0, 5e-5), rng.uniform(0, 6.28)),
            )
            for j in range(5)
        )
        bare = replace(sheet, armature=np.zeros(5))
        rate = float(rng.choice([2000.0, 5000.0]))
        noise = rng.uniform(0.002, 0.008)
        return Palletizer(bare, sheet, joints, 0.0, (), 2 * np.pi * rng.uniform(6, 14), rate, noise)

    def ideal(self, robot: Palletizer) -> Palletizer:
        """Stiff, with viscous friction alone."""
        plain = tuple(
            Joint(each.rotor, 1e3 * each.stiffness, each.fv, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, (0.0, 1, 0.0), 0.0)
            for each in robot.joints
        )
        return replace(robot, joints=plain, sheet=replace(robot.sheet, coulomb=np.zeros(5)))

    def places(self, robot: Palletizer) -> tuple[Place, ...]:
        """Effects that such an arm can have while it keeps to its path, and their joints."""
        of_joints = (
            "stribeck_friction",
            "asymmetric_friction",
            "nonlinear_viscous_friction",
            "load_dependent_friction",
            "thermal_friction_drift",
            "transmission_ripple",
            "joint_elasticity",
            "cable_spring",
            "torque_gain_error",
            "actuator_lag",
            "encoder_offset",
            "encoder_eccentricity",
            "external_contact",
        )
        places = [Place(effect, joint) for effect in of_joints for joint in range(5)]
        places += [Place("gravity_spring", 1), Place("gravity_spring", 2), Place("joint_coupling", 3, 4)]
        places += [Place(effect) for effect in ("payload", "base_tilt", "torque_delay")]
        turned = [
            Place(UNKNOWN, joint, None, "a torque constant that the angle changes") for joint in range(5)
        ]
        rested = [
            Place(UNKNOWN, joint, None, "friction that grows after each reversal") for joint in range(5)
        ]
        return (*places, *turned, *rested)

    def faulty(self, robot: Palletizer, place: Place, size: float, rng: np.random.Generator) -> Palletizer:
        """The robot with one of them."""
        sign = rng.choice([-1, 1])
        if place.effect == "payload":
            mass = 0.25 * size * robot.links.mass[-1]
            return replace(robot, links=robot.links.carrying(mass, rng.uniform(-0.1, 0.3, 3)))
        if place.effect == "base_tilt":
            roll, pitch = 0.02 * size * rng.uniform(0.4, 1, 2) * rng.choice([-1, 1], 2)
            return replace(robot, links=robot.links.tilted(roll, pitch))
        if place.effect == "torque_delay":
            return replace(robot, delay=0.006 * size)
        assert place.joint is not None
        own, sheet = robot.joints[place.joint], robot.sheet
        fc, fv, speed = own.fc, own.fv, 0.3 * sheet.speed[place.joint]
        if place.effect == "joint_coupling":
            assert place.into is not None
            return replace(robot, pairs=((place.joint, place.into, 0.5 * fv * size, 0.5 * fc * size),))
        changes: dict[str, object]
        match place.effect:
            case "stribeck_friction":
                changes = {"extra": own.extra + 0.8 * fc * size, "velocity": rng.uniform(0.04, 0.25)}
            case "asymmetric_friction":
                changes = {
                    "offset": own.offset + sign * 0.3 * fc * size,
                    "difference": own.difference + rng.choice([-1, 1]) * 0.2 * fv * size,
                }
            case "nonlinear_viscous_friction":
                power = rng.choice([0.4, 0.5, 0.6, 2.0])
                changes = {"power": power, "bend": 0.6 * (fc + fv * speed) * size / speed**power}
            case "load_dependent_friction":
                changes = {"load": own.load + 0.06 * size}
            case "thermal_friction_drift":
                changes = {"drop": min(0.4 * size, 0.9), "warming": rng.uniform(4, 20)}
            case "transmission_ripple":
                changes = {"ripple": (0.5 * fc * size, int(rng.integers(3, 40)), rng.uniform(0, 6.28))}
            case "joint_elasticity":
                changes = {"stiffness": own.stiffness / (1 + 20 * size)}
            case "cable_spring":
                changes = {"cable": (0.5 * fc * size, rng.uniform(0, 0.5))}
            case "gravity_spring":
                changes = {"spring": (0.1 * sheet.torque[place.joint] * size, rng.uniform(-0.5, 0.5))}
            case "torque_gain_error":
                changes = {"gain": own.gain + sign * min(0.08 * size, 0.45)}
            case "actuator_lag":
                changes = {"lag": 0.008 * size}
            case "encoder_offset":
                changes = {"zero": sign * 0.02 * size}
            case "encoder_eccentricity":
                changes = {"eccentric": (0.006 * size, rng.uniform(-3, 3))}
            case "external_contact":
                force = sign * 0.15 * sheet.torque[place.joint] * size
                changes = {"push": (force, rng.uniform(2, 6), rng.uniform(0.3, 1))}
            case _ if "constant" in place.law:
                changes = {"commutation": min(0.12 * size, 0.6)}
            case _:
                changes = {"dwell": 0.6 * fc * size}
        joints = list(robot.joints)
        joints[place.joint] = replace(own, **changes)  # type: ignore[arg-type]  # names and types are Joint's
        return replace(robot, joints=tuple(joints))

    def links(self, robot: Palletizer) -> Links:
        """Of the data sheet."""
        return robot.sheet

    def motion(self, robot: Palletizer, rng: np.random.Generator) -> Motion:
        """Sines, 8 to 10 s."""
        sheet = robot.sheet
        return waves(rng, sheet.lower, sheet.upper, sheet.speed, float(rng.uniform(8, 10)), robot.rate, 5)

    def run(self, robot: Palletizer, motion: Motion, rng: np.random.Generator | None) -> Recording:
        """Torque that the motion of the links took, as the drives report it."""
        joints, rate = robot.joints, robot.rate
        q, dq, ddq = (_followed(part, robot.band, rate) for part in motion)
        zero = np.array([each.zero for each in joints])
        eccentric, phase = np.array([each.eccentric for each in joints]).T
        # The servo brings the reading to the reference: the joint is off by the encoder's error.
        wave, slope = eccentric * np.sin(q + phase), 1 - eccentric * np.cos(q + phase)
        q, dq, ddq = q - zero - wave, dq * slope, ddq * slope + wave * dq**2
        carried = inverse_along(*robot.links.body, q, dq, ddq)
        time = np.arange(len(q)) / rate
        for j, each in enumerate(joints):
            force, start, length = each.push
            inside = np.clip((time - start) / length, 0, 1)
            carried[:, j] += each.cable[0] * (q[:, j] - each.cable[1]) - force * np.sin(np.pi * inside) ** 2
            carried[:, j] -= each.spring[0] * np.sin(each.spring[1] - q[:, j])
        wind = carried / np.array([each.stiffness for each in joints])
        # A wind-up is as smooth as the motion; its derivatives are by differences.
        dwind = np.gradient(wind, 1 / rate, axis=0)
        motor, spin, jerk = q + wind, dq + dwind, ddq + np.gradient(dwind, 1 / rate, axis=0)
        torque = np.column_stack(
            [
                _drive(each, motor[:, j], spin[:, j], jerk[:, j], carried[:, j], rate)
                for j, each in enumerate(joints)
            ]
        )
        for first, second, viscous, coulomb in robot.pairs:
            both = spin[:, first] + spin[:, second]
            torque[:, [first, second]] += (viscous * both + coulomb * np.tanh(both / SMOOTH))[:, None]
        torque = np.column_stack(
            [_reported(each, motor[:, j], torque[:, j], rate) for j, each in enumerate(joints)]
        )
        if robot.delay > 0:
            torque = np.column_stack([np.interp(time + robot.delay, time, column) for column in torque.T])
        seen = motor + zero + eccentric * np.sin(motor + zero + phase)
        if rng is not None:
            quantum = 2 * np.pi / 2.0**20
            seen = quantum * np.round(seen / quantum)
            torque = torque + robot.noise * robot.sheet.torque * rng.standard_normal(torque.shape)
        return log_of(self.name, robot.sheet, rate, seen, torque, motion)


def _drive(joint: Joint, q: Array, v: Array, a: Array, carried: Array, rate: float) -> Array:
    """Torque of one motor, (N,), from its motion and what its gearbox carries."""
    way, fast = np.tanh(v / SMOOTH), np.abs(v)
    level = joint.fc + joint.load * np.abs(carried) + joint.extra * np.exp(-((v / joint.velocity) ** 2))
    if joint.dwell:
        # Time since the last reversal.
        index = np.arange(len(v))
        turned = np.maximum.accumulate(np.where(np.diff(np.sign(v), prepend=0.0) != 0, index, 0))
        level = level + joint.dwell * (1 - np.exp(-(index - turned) / rate / 0.4))
    viscous = joint.fv * v
    if joint.drop:
        scale = joint.fc * np.mean(fast) + joint.fv * np.mean(fast**2)
        decay = np.exp(-1 / rate / joint.warming)
        power = (level + joint.fv * fast) * fast / scale
        viscous = viscous * (1 - joint.drop * np.clip(lfilter([1 - decay], [1, -decay], power), 0, 1))
    friction = level * way + viscous + joint.offset + joint.difference * fast
    friction += joint.bend * fast**joint.power * way
    size, cycles, phase = joint.ripple
    return joint.rotor * a + friction + carried - size * np.sin(cycles * q + phase)


def _reported(joint: Joint, q: Array, torque: Array, rate: float) -> Array:
    """Torque that the drive reports, (N,), where it delivers ``torque``."""
    reported = torque / (1 + joint.gain) * (1 + joint.commutation * np.sin(2 * q))
    return reported + joint.lag * np.gradient(reported, 1 / rate) if joint.lag else reported


def _followed(part: Array, band: float, rate: float) -> Array:
    """(N, n) behind a critically damped servo of the second order."""
    b, a = bilinear([band**2], [1, 2 * band, band**2], rate)
    rest = lfilter_zi(b, a)[:, None] * part[0]
    return np.asarray(lfilter(b, a, part, axis=0, zi=rest)[0])


PLANT = PalletizerPlant()
