"""Torque of a position servo in a step, and the most friction that may oppose it: the laws of plant.py."""

import numpy as np
from numpy.typing import NDArray

from ..kinematics import kernel
from ..parameters import COULOMB
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
def drive_slopes(
    own: Array,
    kp: float,
    kd: float,
    mean: float,
    position: float,
    speed: float,
    acceleration: float,
    middle: float,
    h: float,
    out: Array,
) -> float:
    """Derivatives of damping times the middle speed less offset by the joint's row into ``out`` (WIDTH,), and
    minus its derivative by the mean command, which is that by the position.

    Of ``drive_torque`` at full strength with the encoder at the motor; middle: rad/s, of the step.
    """
    stiffness, distance, side = own[KP_SCALE] * kp, mean - position, 0.0
    band = own[DEADBAND]
    if band > 0.0:
        error = distance - 0.5 * h * speed
        side = 1.0 if error > 0 else -1.0
        distance -= band * side
        if abs(error) <= band:
            stiffness = 0.0
    out[KP_SCALE] = kp * (0.5 * h * middle - distance) if stiffness > 0.0 else 0.0
    out[KD_SCALE], out[DEADBAND] = kd * middle, stiffness * side
    damping = own[KD_SCALE] * kd + 0.5 * h * stiffness
    expected = stiffness * distance - damping * (speed + 0.5 * h * acceleration)
    most = own[KP_SCALE] * own[STALL]
    if abs(expected) > most:
        side = 1.0 if expected > 0 else -1.0
        out[KP_SCALE], out[STALL] = -side * own[STALL], -side * own[KP_SCALE]
        out[KD_SCALE] = out[DEADBAND] = stiffness = damping = 0.0
        expected = side * most
    out[BACK_EMF] = middle
    expected -= own[BACK_EMF] * (speed + 0.5 * h * acceleration)
    if abs(expected) > own[LIMIT]:
        out[KP_SCALE] = out[KD_SCALE] = out[DEADBAND] = out[STALL] = out[BACK_EMF] = stiffness = 0.0
        out[LIMIT] = -1.0 if expected > 0 else 1.0
    return stiffness


@kernel
def friction_slopes(
    own: Array, position: float, speed: float, load: float, share: float, out: Array
) -> tuple[float, float, float]:
    """Derivatives of share times ``friction_level`` by the joint's row into ``out`` (WIDTH,), and by the
    position, the speed and the load."""
    if friction_level(own, position, speed, load) <= 0.0:
        return 0.0, 0.0, 0.0
    slip = speed / own[STRIBECK_VELOCITY]
    peak = np.exp(-slip * slip)
    by_slip = -2.0 * slip * own[EXTRA] * peak
    out[COULOMB], out[EXTRA], out[LOAD_FRICTION] = share, share * peak, share * abs(load)
    out[FRICTION_SLOPE] = share * (position - own[FRICTION_CENTRE])
    out[FRICTION_CENTRE] = -share * own[FRICTION_SLOPE]
    out[STRIBECK_VELOCITY] = -share * by_slip * slip / own[STRIBECK_VELOCITY]
    by_load = own[LOAD_FRICTION] if load > 0 else -own[LOAD_FRICTION]
    return share * own[FRICTION_SLOPE], share * by_slip / own[STRIBECK_VELOCITY], share * by_load


@kernel
def friction_level(own: Array, position: float, motor_speed: float, load: float) -> float:
    """Highest friction, N·m, at a position and the motor's speed, with the load that the gearbox carries."""
    slip = motor_speed / own[STRIBECK_VELOCITY]
    level = own[12] + own[FRICTION_SLOPE] * (position - own[FRICTION_CENTRE])
    level += own[EXTRA] * np.exp(-slip * slip) + own[LOAD_FRICTION] * abs(load)
    return max(0.0, level)
