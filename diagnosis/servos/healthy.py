"""A robot in order: how far its links, joints and drives may be from the model and what is stated."""

import numpy as np
from numpy.typing import NDArray

from identification.chain import Chain
from identification.output_error.plant import DELAY, FRICTION_CENTRE, KD_SCALE, KP_SCALE
from identification.output_error.unknowns import (
    GAIN_BOUNDS,
    OFFSET_SHARE,
    Builder,
    Knowledge,
    Unknowns,
    inertial_directions,
)
from identification.parameters import ARMATURE, COULOMB, OFFSET, PER_JOINT, VISCOUS
from identification.prior import parameter_widths

Array = NDArray[np.float64]

# s, and sample intervals, that a command is late where no range is stated.
LATE, LATE_SAMPLES = 0.002, 0.1


def healthy_unknowns(
    chain: Chain, table: Array, known: Knowledge, rate: float, is_delay_stated: bool
) -> Unknowns:
    """The unknowns of a limb in order, about what is stated of it (n, WIDTH). rate: Hz, of its logs.

    Links, rotors and friction within the widths of ``prior.py``; gains within ``known.gain_spread``; delays
    within what is stated, else some milliseconds.
    """
    acceleration = known.torque_scale / known.inertia
    widths = parameter_widths(
        table[:, :PER_JOINT].ravel(), known.torque_scale, known.speed_scale, acceleration
    ).reshape(-1, PER_JOINT)
    table = table.copy()
    table[:, FRICTION_CENTRE] = known.centre
    build = Builder(table)
    for direction in inertial_directions(chain, table, known.torque_scale, known.speed_scale, known.inertia):
        build.add("inertia", "-", -1, direction, 0.0, 1.0)
    for joint in range(chain.joints):
        for name, unit, column in (
            ("armature", "kg·m²", ARMATURE),
            ("viscous", "N·m·s/rad", VISCOUS),
            ("coulomb", "N·m", COULOMB),
        ):
            build.of_joint(name, unit, joint, column, float(widths[joint, column]))
        width = OFFSET_SHARE * known.torque_scale[joint]
        build.of_joint("offset", "N·m", joint, OFFSET, width, (-np.inf, np.inf))
        spread = known.gain_spread[joint]
        if spread > 0:
            build.of_joint("kp_scale", "-", joint, KP_SCALE, spread, GAIN_BOUNDS)
            build.of_joint("kd_scale", "-", joint, KD_SCALE, spread, GAIN_BOUNDS)
        lower, upper = known.delay_lower[joint], known.delay_upper[joint]
        if upper > lower:
            width = (upper - lower) / np.sqrt(12) if is_delay_stated else LATE + LATE_SAMPLES / rate
            build.of_joint("delay", "s", joint, DELAY, width, (lower, upper))
        build.of_voltage(joint, known)
    return build.unknowns()
