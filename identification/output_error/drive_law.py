"""What a position servo gives in a step, and how much friction may oppose it: the laws of plant.py."""

import numpy as np
from numpy.typing import NDArray

from ..kinematics import kernel
from .plant import (
    BACK_EMF,
    DEADBAND,
    EXTRA,
    FRICTION_CENTRE,
    FRICTION_SLOPE,
    KD_SCALE,
    KP_SCALE,
    LIMIT,
    LOAD_FRICTION,
    STALL,
    STRIBECK_VELOCITY,
)

Array = NDArray[np.float64]


@kernel
def drive_torque(
    own: Array,
    kp: float,
    kd: float,
    mean: float,
    strength: float,
    position: float,
    speed: float,
    acceleration: float,
    motor_speed: float,
    is_implicit: bool,
    h: float,
) -> tuple[float, float]:
    """Torque of a step of h s as offset - damping times the motor's mean speed in it.

    own: (WIDTH,) the joint's row of the table. mean: command in the step, rad. strength: share of the torque
    that the supply leaves. position, speed, acceleration: at the encoder, as the step begins. is_implicit:
    whether the encoder sees the motor; else what the servo damps is another speed than the motor's.
    """
    stiffness = strength * own[KP_SCALE] * kp
    error = mean - position - 0.5 * h * speed
    band = own[DEADBAND]
    if abs(error) <= band and band > 0.0:
        stiffness = 0.0
    elif band > 0.0:
        mean -= band if error > 0 else -band
    offset = stiffness * (mean - position)
    damping = strength * own[KD_SCALE] * kd + 0.5 * h * stiffness
    middle = speed + 0.5 * h * acceleration
    expected = offset - damping * middle
    # Full voltage: what scales kp scales its torque as well.
    most = strength * own[KP_SCALE] * own[STALL]
    if abs(expected) > most:
        offset, damping = most if expected > 0 else -most, 0.0
    elif not is_implicit:
        offset, damping = expected, 0.0
    # What the voltage gives less what the motor's own speed takes of it.
    damping += own[BACK_EMF]
    expected = offset - damping * (middle if is_implicit else motor_speed)
    if abs(expected) > own[LIMIT]:
        offset, damping = own[LIMIT] if expected > 0 else -own[LIMIT], 0.0
    return offset, damping


@kernel
def friction_level(own: Array, position: float, motor_speed: float, load: float) -> float:
    """Highest friction, N·m, at a position and the motor's speed, with the load that the gearbox carries."""
    slip = motor_speed / own[STRIBECK_VELOCITY]
    level = own[12] + own[FRICTION_SLOPE] * (position - own[FRICTION_CENTRE])
    level += own[EXTRA] * np.exp(-slip * slip) + own[LOAD_FRICTION] * abs(load)
    return max(0.0, level)
