"""A robot with its drives as one table of figures, and its limbs, which move without each other.

The table has a row a joint: the 14 standard parameters of the link, then the figures of its drive and of
what a rigid body lacks (``COLUMNS``). A position servo's torque is

    u = kp_scale kp (command(t - delay) - q) - kd_scale kd dq, clipped at its limit,

with the command held from sample to sample; kp and kd are those that a run states. A servo that sets the
voltage of its motor has that clipped at kp_scale times the torque ``stall`` of its supply, and loses
``back_emf`` dq of it before the limit, which is that of its current. Friction opposes the motion with at most

    fc + slope (q - centre) + extra exp(-(v / v_s)²) + mu |load|,

load being what the gearbox carries (without the rotor's own inertia); nowhere less than nothing.

The rest is zero in a drive as stated: a play ``gap`` between motor and link, with the encoder at the motor or
(``encoder_after`` 1) at the link; a ``deadband`` of the position error; a ``command_step`` that the firmware
rounds the command to; the inverse of the speed at which it follows it; and the share of the torque that is
lost for each N·m that all drives give together (``sag``).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..chain import Chain
from ..parameters import PER_JOINT, SYMBOLS

Array = NDArray[np.float64]

DRIVE = (
    "kp_scale", "kd_scale", "delay", "limit", "extra", "stribeck_velocity", "load_friction",
    "gap", "encoder_after", "deadband", "command_step", "inverse_rate", "sag",
    "friction_slope", "friction_centre", "stall", "back_emf",
)  # fmt: skip
COLUMNS = (*SYMBOLS, *DRIVE)
WIDTH = len(COLUMNS)
KP_SCALE, KD_SCALE, DELAY, LIMIT, EXTRA, STRIBECK_VELOCITY, LOAD_FRICTION = range(PER_JOINT, PER_JOINT + 7)
GAP, ENCODER_AFTER, DEADBAND, COMMAND_STEP, INVERSE_RATE, SAG = range(PER_JOINT + 7, PER_JOINT + 13)
FRICTION_SLOPE, FRICTION_CENTRE, STALL, BACK_EMF = range(PER_JOINT + 13, WIDTH)


def plant_table(parameters: Array, delay: Array, limit: Array) -> Array:
    """The table (n, WIDTH) of standard parameters (14 n,) and drives (n,) as stated, without other effects.

    delay: s. limit: N·m, infinite where there is none.
    """
    table = np.zeros((len(delay), WIDTH))
    table[:, :PER_JOINT] = parameters.reshape(-1, PER_JOINT)
    table[:, [KP_SCALE, KD_SCALE, STRIBECK_VELOCITY]] = 1.0
    table[:, DELAY], table[:, LIMIT], table[:, STALL] = delay, limit, np.inf
    return table


@dataclass(frozen=True)
class Limb:
    """Joints of a robot that hang on its base by one joint: on a fixed base they move without the others.

    joints: (m,) indices among the robot's. chain: of these joints alone.
    """

    joints: NDArray[np.int64]
    chain: Chain


def limbs(chain: Chain) -> tuple[Limb, ...]:
    """The limbs of a robot, base to tip; an arm is one."""
    roots = np.arange(chain.joints)
    for joint in range(chain.joints):
        if chain.parent[joint] >= 0:
            roots[joint] = roots[chain.parent[joint]]
    return tuple(
        Limb(own, _part(chain, own)) for own in (np.flatnonzero(roots == r) for r in np.unique(roots))
    )


def _part(chain: Chain, joints: Sequence[int] | NDArray[np.int64]) -> Chain:
    """The chain of some joints; every one's parent is the base or among them."""
    places = {int(joint): place for place, joint in enumerate(joints)}
    parents = [places.get(int(chain.parent[joint]), -1) for joint in joints]
    return Chain(
        joint_names=tuple(chain.joint_names[joint] for joint in joints),
        parent=np.array(parents, dtype=np.int64),
        is_slide=chain.is_slide[joints],
        rotation=np.ascontiguousarray(chain.rotation[joints]),
        translation=np.ascontiguousarray(chain.translation[joints]),
        gravity=chain.gravity,
        springs=np.ascontiguousarray(chain.springs[joints]),
    )
