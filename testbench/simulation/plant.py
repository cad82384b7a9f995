"""The physics of the simulated robot: MuJoCo's smooth dynamics with the friction taken out."""

import copy
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from identification.chain import Chain
from identification.errors import InputError

from .bare_model import bare_model
from .hooks import Standstill
from .mujoco_pointers import installed_control

Array = NDArray[np.float64]

_OFF = mujoco.mjtDisableBit
# Clearance and limits are certified when a motion is designed.
DISABLED = (
    _OFF.mjDSBL_CONSTRAINT
    | _OFF.mjDSBL_CONTACT
    | _OFF.mjDSBL_SENSOR
    | _OFF.mjDSBL_EULERDAMP
    | _OFF.mjDSBL_AUTORESET
)
ITERATIONS = 200


def plant_model(model: Any, timestep: float) -> Any:
    """A copy of a compiled model that steps with semi-implicit Euler and without friction.

    Linear damping and frictionloss are zero in it: the callback applies them exactly. Springs,
    gravity compensation and fluid forces stay.
    """
    # Compiling runs the dynamics once, and with it whatever callback the process has.
    with installed_control(None):
        # A model that cannot do without its geoms comes back as it is.
        plant = copy.copy(bare_model(model))
    plant.dof_damping[:] = 0.0
    plant.dof_frictionloss[:] = 0.0
    plant.opt.timestep = timestep
    plant.opt.integrator = mujoco.mjtIntegrator.mjINT_EULER
    plant.opt.disableflags = int(model.opt.disableflags | DISABLED)
    plant.opt.enableflags = 0
    # mjcb_control is not called with actuation disabled, so the actuators are, as one group.
    plant.actuator_group[:] = 0
    plant.opt.disableactuator = 1
    return plant


def add_to_diagonal(plant: Any, inertia: Array, links: NDArray[np.int64]) -> None:
    """Add to the diagonal of the plant's mass matrix, in place; inertia: (n,) kg·m² (kg), at these links."""
    if np.any(inertia):
        plant.dof_armature[links] += inertia
        # MuJoCo keeps the inertia of a joint with nothing behind it, rotor included, as a constant.
        mujoco.mj_setConst(plant, mujoco.MjData(plant))


def resting_pose(
    plant: Any,
    chain: Chain,
    reference: Array,
    feedforward: Array,
    kp: Array,
    torque_limit: Array,
    standstill: Standstill,
) -> tuple[Array, Array, Array]:
    """Pose of the links where the controller just holds the arm, windup and torque there; each (n,).

    Solves kp (reference - r) + feedforward = g(q) by fixed-point iteration, a contraction where kp
    exceeds the stiffness of gravity: r is the reading at q, and g holds gravity, springs and the torque
    of the effects. Raises InputError when gains or torque limits cannot hold the arm.
    """
    pose = reference.copy()
    data = mujoco.MjData(plant)
    for _ in range(ITERATIONS):
        data.qpos[:] = chain.link_positions(pose)
        mujoco.mj_fwdPosition(plant, data)
        mujoco.mj_fwdVelocity(plant, data)
        static_load = chain.at_joints((data.qfrc_bias - data.qfrc_passive)[None])[0]
        torque = static_load - standstill.torque(pose, static_load)
        windup = standstill.windup(pose, torque)
        # What the encoder reads beyond the link's position.
        ahead = standstill.reading(pose + windup, static_load) - pose
        if (np.abs(torque) > torque_limit).any():
            joint = int(np.argmax(np.abs(torque) - torque_limit))
            got = f"{abs(torque[joint]):.4g} to hold joint {joint + 1} at the start"
            raise InputError("simulation", "torque limit", f"at most {torque_limit[joint]:g} N·m", got)
        error = torque - feedforward
        sag = np.divide(error, kp, out=np.where(error == 0.0, 0.0, np.inf), where=kp > 0)
        change = np.abs(reference - sag - ahead - pose).max()
        if not np.isfinite(change):
            break
        pose = reference - sag - ahead
        if change <= 1e-14 * (1 + np.abs(pose).max()):
            return pose, windup, torque
    raise InputError(
        "simulation",
        "controller kp",
        "gains that hold the arm at the start against gravity: a higher bandwidth or control rate",
        kp.round(3).tolist(),
    )
