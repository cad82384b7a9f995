"""The job behind ``parity``: torque of our regressor and of MuJoCo held against Pinocchio's on a model."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from identification.errors import InputError
from identification.parameters import COULOMB, OFFSET, PER_JOINT, VISCOUS
from identification.regressor import regressor
from identification.springs import spring_torque

from ..model_reading.locking import standing
from ..model_reading.reading import Choice
from ..model_reading.selection import FREE
from ..robot import Robot, load_robot, print_notes

Array = NDArray[np.float64]

STATES = 200
# rad (m), rad/s and rad/s²: how far states reach where the model sets no limit.
UNLIMITED = (np.pi, 2.0, 10.0)
# Of the largest torque: all that differs less is rounding.
ROUNDING = 1e-9
FREE_WIDTH = 7
# MuJoCo's positions of a joint as Pinocchio has them, by how many Pinocchio has: a quaternion's scalar is its
# last number there, and a joint without a range is a cosine and a sine.
IN_PINOCCHIO: dict[int, Callable[[Array], Array]] = {
    1: lambda own: own,
    2: lambda own: np.array([np.cos(own[0]), np.sin(own[0])]),
    4: lambda own: own[[1, 2, 3, 0]],
    FREE_WIDTH: lambda own: own[[0, 1, 2, 4, 5, 6, 3]],
}
EXTRA = "Pinocchio: pip install 'identification-testbench[parity]'"


@dataclass(frozen=True)
class Difference:
    """The largest difference between two torques: N·m (N), and the joint's index."""

    value: float
    joint: int


@dataclass(frozen=True)
class Parity:
    """Largest differences, N·m (N), over random states.

    regressor, mujoco: of ours and of MuJoCo from Pinocchio. ours: of our regressor from MuJoCo.
    torque: (n,) N·m (N), each joint's largest.
    """

    regressor: Difference
    mujoco: Difference
    ours: Difference
    torque: Array

    @property
    def sentence(self) -> str:
        """Who agrees with whom."""
        rounding = ROUNDING * float(self.torque.max())
        if max(self.regressor.value, self.mujoco.value) <= rounding:
            return "all three agree to rounding"
        if self.ours.value <= rounding:
            return (
                "regressor and MuJoCo agree to rounding: Pinocchio reads this file otherwise, as it does a "
                "turned base, MuJoCo's boundmass, or inertia that no body can have"
            )
        return "they differ by more than rounding"


def parity_of_model(model: Path, choice: Choice | None = None) -> Parity:
    """Hold the model's torques against Pinocchio's and print the largest differences. Raises InputError."""
    robot = load_robot(model, choice)
    print_notes(robot)
    found = parity(robot)
    units = robot.units()
    print(f"{robot.path}: torque of {robot.joints} joints at {STATES} random states; largest differences")
    for name, each in (("regressor", found.regressor), ("MuJoCo", found.mujoco)):
        unit, joint = units[each.joint], robot.joint_names[each.joint]
        print(f"  {name:9} from Pinocchio: {each.value:.2g} {unit} at {joint}")
    largest = int(np.argmax(found.torque))
    text = f"{found.torque[largest]:.3g} {units[largest]} at {robot.joint_names[largest]}"
    print(f"  largest torque {text}")
    print(found.sentence)
    return found


def parity(robot: Robot, states: int = STATES, seed: int = 0) -> Parity:
    """Torque but for Coulomb friction by three implementations at random states within the limits.

    Raises InputError where Pinocchio is not installed, or cannot read the model.
    """
    theirs = pinocchio_model(robot)
    q, dq, ddq = random_states(robot, states, seed)
    table = robot.parameters.reshape(-1, PER_JOINT).copy()
    table[:, [COULOMB, OFFSET]] = 0.0
    springs = spring_torque(robot.chain.springs, q)
    chain = robot.chain
    ours = regressor(chain, q, dq, ddq) @ table.ravel() + springs
    tree, links = chain.tree, (chain.link_positions(q), chain.link_motions(dq), chain.link_motions(ddq))
    by_mujoco = chain.at_joints(mujoco_torques(robot.spec().compile(), *links))
    by_pinocchio = chain.at_joints(pinocchio_torques(theirs, tree.joint_names, *links))
    by_pinocchio += table[: robot.joints, VISCOUS] * dq + springs
    return Parity(
        regressor=_largest(ours - by_pinocchio),
        mujoco=_largest(by_mujoco - by_pinocchio),
        ours=_largest(ours - by_mujoco),
        torque=np.abs(by_pinocchio).max(axis=0),
    )


def random_states(robot: Robot, count: int, seed: int) -> tuple[Array, Array, Array]:
    """q, dq, ddq, each (count, n), drawn evenly within the limits of the model."""
    limits, rng = robot.limits, np.random.default_rng(seed)
    reach, speed, acceleration = UNLIMITED
    lower, upper = (
        np.where(np.isfinite(e), e, s * reach) for e, s in ((limits.lower, -1), (limits.upper, 1))
    )
    widths = [
        np.where(np.isfinite(limit), limit, most)
        for limit, most in ((limits.velocity, speed), (limits.acceleration, acceleration))
    ]
    dq, ddq = (rng.uniform(-1, 1, (count, robot.joints)) * width for width in widths)
    return rng.uniform(lower, upper, (count, robot.joints)), dq, ddq


def mujoco_torques(model: mujoco.MjModel, q: Array, dq: Array, ddq: Array) -> Array:
    """mj_inverse, (N, n) N·m, without constraints: friction loss is left to exact Coulomb friction."""
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
    data, out = mujoco.MjData(model), np.empty_like(q)
    for sample in range(len(q)):
        data.qpos[:], data.qvel[:], data.qacc[:] = q[sample], dq[sample], ddq[sample]
        mujoco.mj_inverse(model, data)
        out[sample] = data.qfrc_inverse
    return out


def pinocchio_torques(model: Any, joint_names: tuple[str, ...], q: Array, dq: Array, ddq: Array) -> Array:
    """Pinocchio's rnea, (N, n) N·m: rigid bodies and armature. joint_names: in the order of the columns."""
    import pinocchio

    order = np.arange(model.nv)
    # Joints of one body are one joint of Pinocchio's, in the same order.
    if all(model.existJointName(name) for name in joint_names):
        order = np.array([model.joints[model.getJointId(name)].idx_v for name in joint_names])
    data, zero, out = model.createData(), pinocchio.neutral(model), np.empty_like(q)
    states = np.zeros((3, len(q), model.nv))
    states[:, :, order] = q, dq, ddq
    for sample, (position, velocity, acceleration) in enumerate(states.transpose(1, 0, 2)):
        # A joint without a range is a cosine and a sine to Pinocchio.
        configuration = pinocchio.integrate(model, zero, position)
        out[sample] = pinocchio.rnea(model, data, configuration, velocity, acceleration)[order]
    return out


def pinocchio_model(robot: Robot) -> Any:
    """The robot as Pinocchio reads its file, other joints held as they are here. Raises InputError."""
    try:
        import pinocchio
    except ImportError:
        raise InputError("testbench", "parity", EXTRA, "not installed") from None
    path, names = robot.path, robot.chain.link_names
    try:
        if path.suffix.lower() == ".urdf":
            model = pinocchio.buildModelFromUrdf(str(path))
            zero = pinocchio.neutral(model)
            held = np.clip(zero, model.lowerPositionLimit, model.upperPositionLimit)
        else:
            model = pinocchio.buildModelFromMJCF(str(path))
            held = _configuration(model, mujoco.MjModel.from_xml_path(str(path)))
        others = [joint for joint in range(1, model.njoints) if model.names[joint] not in names]
        if model.nv != len(names):
            model = pinocchio.buildReducedModel(model, others, held)
    # Whatever it raises of a file is Pinocchio's answer.
    except Exception as error:
        raise InputError(path, "model", "a model that Pinocchio reads", error) from None
    if model.nv != len(names):
        got = f"{model.nv} degrees of freedom"
        raise InputError(path, "model", f"{len(names)} joints to Pinocchio as well", got)
    model.gravity.linear = robot.model.opt.gravity
    return model


def _configuration(model: Any, whole: mujoco.MjModel) -> Array:
    """Pinocchio's configuration (nq,) of the positions that joints are held at. whole: the file in MuJoCo."""
    import pinocchio

    out, (qpos, _) = pinocchio.neutral(model), standing(whole)
    free = iter(np.flatnonzero(whole.jnt_type == FREE).tolist())
    for name, joint in zip(model.names, model.joints, strict=True):
        known = mujoco.mj_name2id(whole, mujoco.mjtObj.mjOBJ_JOINT, name)
        # Free joints seldom have a name.
        index = next(free) if joint.nq == FREE_WIDTH else known
        if index < 0 or joint.nq not in IN_PINOCCHIO:
            continue
        start = int(whole.jnt_qposadr[index])
        part = slice(joint.idx_q, joint.idx_q + joint.nq)
        out[part] = IN_PINOCCHIO[joint.nq](qpos[start : start + joint.nq])
    return out


def _largest(difference: Array) -> Difference:
    each = np.abs(difference).max(axis=0)
    return Difference(float(each.max()), int(np.argmax(each)))
