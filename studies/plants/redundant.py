"""A seven-axis arm in MuJoCo from end to end: servos, soft friction, tendons, compliant joints.

The model is written as MJCF and rolled out by ``mujoco.rollout``: position servos with feedforward torque
beside
them, ``frictionloss`` as the soft constraint it is. What MJCF has no field for (ripple, asymmetry) acts as
a torque
along the reference, which the arm follows closely.
"""

import re
from dataclasses import dataclass, replace

import mujoco
import numpy as np
from mujoco import rollout
from numpy.typing import NDArray

from testbench.log import Recording

from .drawing import UNKNOWN, Place, log_of
from .links import Links, inverse_along, upright
from .motions import Motion, waves

Array = NDArray[np.float64]

STEP, PERIOD = 1e-3, 4  # s, steps a sample
SOFT = 0.05  # rad/s, width of the tanh in the feedforward's friction


@dataclass(frozen=True)
class Redundant:
    """links: as built. sheet: of the data sheet. gains: (2, n) kp and kv of the servos. changes: to the MJCF.

    offset, difference: (n,) of asymmetric friction. ripple: (3, n) amplitude, cycles, phase. gain: (n,)
    relative.
    bias: name, joint and three figures of a torque of its own. zero, lag: (n,), rad and s. limit: (n,) N·m.
    """

    links: Links
    sheet: Links
    gains: Array
    offset: Array
    difference: Array
    ripple: Array
    gain: Array
    zero: Array
    lag: Array
    limit: Array
    bend: Array
    cable: Array
    soft: tuple[int, float, float] | None
    pairs: tuple[tuple[int, int, float, float], ...]
    bias: tuple[tuple[str, int, float, float, float], ...]
    noise: float


class RedundantPlant:
    """Draws and runs such robots."""

    name = "redundant"

    def robot(self, rng: np.random.Generator) -> Redundant:
        """A healthy robot, 10 to 25 kg."""
        size = rng.uniform(0.8, 1.2)
        lengths = size * np.array([0.2, 0.2, 0.2, 0.2, 0.19, 0.1, 0.09]) * rng.uniform(0.9, 1.1, 7)
        mass = size**3 * np.array([3.5, 3.5, 2.6, 2.4, 1.8, 1.6, 0.5]) * rng.uniform(0.8, 1.2, 7)
        rotor = np.array([0.6, 0.6, 0.4, 0.4, 0.15, 0.12, 0.1]) * rng.uniform(0.8, 1.3, 7)
        links = upright("zyzyzyz", lengths, mass, rotor, rng)
        reach, weight = np.cumsum(lengths[::-1])[::-1], np.cumsum(mass[::-1])[::-1]
        torque = 11 * weight * reach + 15
        coulomb = torque * rng.uniform(0.02, 0.05, 7)
        speed = np.full(7, 2.4)
        links = replace(
            links,
            torque=torque,
            speed=speed,
            lower=-np.array([2.8, 1.8, 2.8, 2.0, 2.8, 1.8, 2.9]),
            upper=np.array([2.8, 1.8, 2.8, 2.0, 2.8, 1.8, 2.9]),
            viscous=coulomb / speed * rng.uniform(1, 3, 7),
            coulomb=coulomb,
        )
        band = 2 * np.pi * rng.uniform(4, 7)
        inertia = rotor + 0.15 * weight * reach**2
        none = np.zeros(7)
        return Redundant(
            links=links,
            sheet=links,
            gains=np.array([band**2 * inertia, 2 * band * inertia]),
            offset=coulomb * rng.normal(0, 0.04, 7),
            difference=links.viscous * rng.normal(0, 0.04, 7),
            ripple=np.array(
                [coulomb * rng.uniform(0.01, 0.06, 7), rng.integers(3, 50, 7), rng.uniform(0, 6.28, 7)]
            ),
            gain=rng.normal(0, 0.005, 7),
            zero=none,
            lag=none,
            limit=np.full(7, 1e6),
            bend=none,
            cable=np.zeros((2, 7)),
            soft=None,
            pairs=(),
            bias=(),
            noise=rng.uniform(0.001, 0.006),
        )

    def ideal(self, robot: Redundant) -> Redundant:
        """Viscous friction alone."""
        none, still = np.zeros(7), replace(robot.links, coulomb=np.zeros(7))
        return replace(
            robot, links=still, sheet=still, offset=none, difference=none, ripple=np.zeros((3, 7)), gain=none
        )

    def places(self, robot: Redundant) -> tuple[Place, ...]:
        """Effects that may be drawn, with joints: those of an MJCF field or acting along the reference."""
        of_joints = (
            "asymmetric_friction",
            "nonlinear_viscous_friction",
            "transmission_ripple",
            "joint_elasticity",
            "backlash",
            "cable_spring",
            "torque_gain_error",
            "actuator_lag",
            "torque_saturation",
            "encoder_offset",
            "external_contact",
        )
        places = [Place(effect, joint) for effect in of_joints for joint in range(7)]
        places += [Place("joint_coupling", joint, joint + 1) for joint in (4, 5)]
        places += [Place("payload"), Place("base_tilt")]
        beat = [Place(UNKNOWN, joint, None, "a torque that beats in time") for joint in range(7)]
        jump = [Place(UNKNOWN, joint, None, "a zero of the torque that jumps") for joint in range(7)]
        return (*places, *beat, *jump)

    def faulty(self, robot: Redundant, place: Place, size: float, rng: np.random.Generator) -> Redundant:
        """The robot with one of them."""
        sign = rng.choice([-1, 1])
        if place.effect == "payload":
            return replace(robot, links=robot.links.carrying(1.2 * size, rng.uniform(-0.06, 0.15, 3)))
        if place.effect == "base_tilt":
            roll, pitch = 0.02 * size * rng.uniform(0.4, 1, 2) * rng.choice([-1, 1], 2)
            return replace(robot, links=robot.links.tilted(roll, pitch))
        j = place.joint
        assert j is not None
        fc, fv, limit = robot.links.coulomb[j], robot.links.viscous[j], robot.links.torque[j]

        def raised(values: Array, by: float) -> Array:
            return values + by * (np.arange(7) == j)

        match place.effect:
            case "asymmetric_friction":
                difference = raised(robot.difference, rng.choice([-1, 1]) * 0.2 * fv * size)
                return replace(
                    robot, offset=raised(robot.offset, sign * 0.3 * fc * size), difference=difference
                )
            case "nonlinear_viscous_friction":
                return replace(robot, bend=raised(robot.bend, 0.5 * fv * size))
            case "transmission_ripple":
                ripple = robot.ripple.copy()
                ripple[:, j] = 0.5 * fc * size, rng.integers(3, 30), rng.uniform(0, 6.28)
                return replace(robot, ripple=ripple)
            case "joint_elasticity":
                inertia = robot.links.armature[j]
                return replace(robot, soft=(j, inertia * (2 * np.pi * 14) ** 2 / size, 0.0))
            case "backlash":
                return replace(robot, soft=(j, 0.0, 0.003 * size))
            case "cable_spring":
                cable = robot.cable.copy()
                cable[:, j] = 0.5 * fc * size, rng.uniform(0, 0.5)
                return replace(robot, cable=cable)
            case "torque_gain_error":
                return replace(robot, gain=raised(robot.gain, sign * min(0.08 * size, 0.45)))
            case "actuator_lag":
                return replace(robot, lag=raised(robot.lag, 0.008 * size))
            case "torque_saturation":
                return replace(robot, limit=np.where(np.arange(7) == j, 0.3 * limit / size, robot.limit))
            case "encoder_offset":
                return replace(robot, zero=raised(robot.zero, sign * 0.02 * size))
            case "external_contact":
                push = ("push", j, sign * 0.2 * limit * size, rng.uniform(2, 5), rng.uniform(0.3, 1))
                return replace(robot, bias=(*robot.bias, push))
            case "joint_coupling":
                assert place.into is not None
                return replace(robot, pairs=((j, place.into, 0.6 * fv * size, 0.6 * fc * size),))
            case _ if "beats" in place.law:
                beat = ("beat", j, 0.4 * fc * size, rng.uniform(3, 9), rng.uniform(0.2, 0.5))
                return replace(robot, bias=(*robot.bias, beat))
            case _:
                jump = ("jump", j, sign * 0.8 * fc * size, rng.uniform(3, 6), 0.0)
                return replace(robot, bias=(*robot.bias, jump))

    def links(self, robot: Redundant) -> Links:
        """Of the data sheet."""
        return robot.sheet

    def motion(self, robot: Redundant, rng: np.random.Generator) -> Motion:
        """Sines, 8 to 10 s, at 1 kHz."""
        sheet, seconds = robot.sheet, float(rng.integers(8, 11))
        return waves(rng, sheet.lower, sheet.upper, sheet.speed, seconds, 1 / STEP)

    def run(self, robot: Redundant, motion: Motion, rng: np.random.Generator | None) -> Recording:
        """Torque is what the servos ask for, 250 times a second."""
        n, sheet = robot.sheet.joints, robot.sheet
        model = mujoco.MjModel.from_xml_string(_mjcf(robot))
        _in_place(model, robot)
        names = [model.joint(name).qposadr[0] for name in sheet.names]
        wanted = motion[0] - robot.zero
        forward = inverse_along(*sheet.body, *motion) + sheet.viscous * motion[1]
        forward += sheet.coulomb * np.tanh(motion[1] / SOFT)
        data = mujoco.MjData(model)
        data.qpos[names] = wanted[0]
        control = np.hstack([wanted, motion[1], forward, _disturbance(robot, motion)])
        if model.na:
            data.act[:] = forward[0][robot.lag > 0]
        size = mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_FULLPHYSICS)
        state = np.empty(size)
        mujoco.mj_getState(model, data, state, mujoco.mjtState.mjSTATE_FULLPHYSICS)
        state, sensed = rollout.rollout(model, data, state[None], control[None])
        # Sensors are those before each step.
        q, v = sensed[0, :, :n], sensed[0, :, n : 2 * n]
        asked = robot.gains[0] * (wanted - q) + robot.gains[1] * (motion[1] - v) + forward
        seen = q + robot.zero
        torque, seen = np.clip(asked, -sheet.torque, sheet.torque)[::PERIOD], seen[::PERIOD]
        if rng is not None:
            quantum = 2 * np.pi / 2.0**18
            seen = quantum * np.round(seen / quantum)
            torque = torque + robot.noise * sheet.torque * rng.standard_normal(torque.shape)
        reference = motion[0][::PERIOD], motion[1][::PERIOD], motion[2][::PERIOD]
        return log_of(self.name, sheet, 1 / STEP / PERIOD, seen, torque, reference)


def _mjcf(robot: Redundant) -> str:
    """The robot with its drives as MJCF."""
    text = robot.links.mjcf("redundant")
    if robot.soft is not None:
        text = _compliant(text, robot)
    actuators, tendons = [], []
    for j, name in enumerate(robot.links.names):
        kp, kv = robot.gains[:, j]
        lag = f'dyntype="filterexact" dynprm="{robot.lag[j]}"' if robot.lag[j] > 0 else ""
        actuators.append((name, kp, kv, 1 + robot.gain[j], robot.limit[j], lag))
    lines = [
        f'<general name="place_{name}" joint="{name}" gainprm="{kp * scale}" biastype="affine" '
        f'biasprm="0 {-kp * scale} 0"/>'
        for name, kp, _, scale, _, _ in actuators
    ]
    lines += [
        f'<general name="rate_{name}" joint="{name}" gainprm="{kv * scale}" biastype="affine" '
        f'biasprm="0 0 {-kv * scale}"/>'
        for name, _, kv, scale, _, _ in actuators
    ]
    lines += [
        f'<general name="forward_{name}" joint="{name}" gainprm="{scale}" {lag}/>'
        for name, _, _, scale, _, lag in actuators
    ]
    outer = "bend_" if robot.soft is not None else ""
    for j, name in enumerate(robot.links.names):
        at = f"{outer}{name}" if robot.soft is not None and robot.soft[0] == j else name
        lines.append(f'<motor name="other_{name}" joint="{at}"/>')
    for first, second, viscous, coulomb in robot.pairs:
        a, b = robot.links.names[first], robot.links.names[second]
        tendons.append(
            f'<fixed damping="{viscous}" frictionloss="{coulomb}"><joint joint="{a}" coef="1"/>'
            f'<joint joint="{b}" coef="1"/></fixed>'
        )
    names = robot.links.names
    sensors = [f'<jointpos joint="{name}"/>' for name in names] + [
        f'<jointvel joint="{name}"/>' for name in names
    ]
    # What clips is the drive, not the data sheet.
    for name, *_, limit, _ in actuators:
        text = re.sub(rf'(name="{name}"[^>]*actuatorfrcrange=")[^"]*', rf"\g<1>{-limit} {limit}", text)
    extra = f"<tendon>{''.join(tendons)}</tendon>" if tendons else ""
    extra += f"<actuator>{''.join(lines)}</actuator><sensor>{''.join(sensors)}</sensor>"
    return text.replace("</mujoco>", f"{extra}</mujoco>")


def _compliant(text: str, robot: Redundant) -> str:
    """The MJCF with one joint in two: motor, rotor and friction before, a spring or a gap behind them."""
    assert robot.soft is not None
    j, stiffness, gap = robot.soft
    name, axis = robot.links.names[j], " ".join(f"{value:g}" for value in robot.links.axis[j])
    if gap > 0:
        second = f'range="{-gap / 2} {gap / 2}" limited="true" solreflimit="0.004 1" damping="0"'
    else:
        second = f'stiffness="{stiffness}" damping="{2e-3 * stiffness}"'
    joint = re.search(rf'<joint name="{name}"[^>]*/>', text)
    assert joint is not None
    # A rotor needs a body of its own, however light.
    rotor = '<inertial pos="0 0 0" mass="1e-3" diaginertia="1e-6 1e-6 1e-6"/>'
    opening = re.search(rf'<body name="link_{j + 1}" pos="([^"]*)">', text)
    assert opening is not None
    end = _end_of_body(text, opening.end())
    inner = text[opening.end() : end].replace(
        joint.group(0), f'<joint name="bend_{name}" axis="{axis}" armature="1e-5" {second}/>'
    )
    outer = f'<body name="rotor_{j + 1}" pos="{opening.group(1)}">{rotor}{joint.group(0)}'
    return text[: opening.start()] + f"{outer}<body>{inner}</body></body>" + text[end + len("</body>") :]


def _end_of_body(text: str, start: int) -> int:
    """Where the closing tag of the body that opens before ``start`` begins."""
    depth = 1
    for tag in re.finditer(r"<body|</body>", text[start:]):
        depth += 1 if tag.group(0) == "<body" else -1
        if depth == 0:
            return start + tag.start()
    raise ValueError("a body that does not end")


def _in_place(model: mujoco.MjModel, robot: Redundant) -> None:
    """Set in the compiled model what its MJCF text leaves out: gravity, springs, curved friction, options."""
    model.opt.gravity[:] = robot.links.gravity
    model.opt.timestep = STEP
    # An implicit step would take the servos' damping at its end, and the log would not show that.
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_EULER
    off = mujoco.mjtDisableBit
    model.opt.disableflags |= off.mjDSBL_CONTACT | off.mjDSBL_EULERDAMP
    for j, name in enumerate(robot.links.names):
        joint = model.joint(name).id
        model.jnt_limited[joint] = 0
        model.jnt_stiffness[joint], model.qpos_spring[joint] = robot.cable[:, j]
        model.dof_dampingpoly[joint, 0] = robot.bend[j]


def _disturbance(robot: Redundant, motion: Motion) -> Array:
    """Torque (N, n) that acts along the reference and in time."""
    q, dq = motion[0], motion[1]
    size, cycles, phase = robot.ripple
    out = size * np.sin(cycles * q + phase) - robot.offset - robot.difference * np.abs(dq)
    time = STEP * np.arange(len(q))
    for name, joint, force, start, length in robot.bias:
        if name == "push":
            out[:, joint] += force * np.sin(np.pi * np.clip((time - start) / length, 0, 1)) ** 2
        elif name == "beat":
            out[:, joint] += force * np.sin(2 * np.pi * start * time) * np.sin(2 * np.pi * length * time)
        else:
            out[:, joint] += force * np.tanh((time - start) / 0.02)
    return np.asarray(out)


PLANT = RedundantPlant()
