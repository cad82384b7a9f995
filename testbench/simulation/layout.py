"""What lies where in the memory of a loop: rows of its arrays, and the context that points at them.

The last axis of every array is the joint.
"""

import numba
import numpy as np

from ..native import pointer_to

CONSTANTS = 11
(
    VISCOUS,
    COULOMB,
    KP,
    KD,
    TORQUE_LIMIT,
    ENCODER_QUANTUM,
    ARMATURE,
    SPLIT,
    IMPLICIT,
    CONTACT_STIFFNESS,
    CONTACT_DAMPING,
) = range(CONSTANTS)
INPUTS = 4
REFERENCE_POSITION, REFERENCE_VELOCITY, FEEDFORWARD, POSITION_NOISE = range(INPUTS)
OUTPUTS = 9
(
    READING,
    POSITION,
    VELOCITY,
    ACCELERATION,
    COMMAND,
    FRICTION,
    DRIVE,
    EFFECT_TORQUE,
    LINK_POSITION,
) = range(OUTPUTS)
MEMORIES = 7
(
    LAST_READING,
    MEASURED_VELOCITY,
    HELD_COMMAND,
    COULOMB_FRICTION,
    LAST_VELOCITY,
    MOTOR_POSITION,
    MOTOR_VELOCITY,
) = range(MEMORIES)
# Rows of scratch before those of ``coulomb_friction``, which takes 2 n + 2.
SCRATCH = 5

CONTEXT = np.dtype(
    [
        ("step", np.int64),
        ("substeps", np.int64),
        ("joints", np.int64),
        ("samples", np.int64),
        ("failed_sample", np.int64),
        ("timestep", np.float64),
        ("rate", np.float64),
        ("velocity_pole", np.float64),
        ("constants", np.int64),
        ("inputs", np.int64),
        ("outputs", np.int64),
        ("memory", np.int64),
        ("work", np.int64),
        ("bus", np.int64),
        ("hooks", np.int64),
        ("edges", np.int64),
        ("led", np.int64),
        ("links", np.int64),
    ]
)
context_pointer = pointer_to(numba.from_dtype(CONTEXT))
