"""The position gain is not the stated one."""

from identification.output_error.plant import KP_SCALE

from ..base import DriveEffect, Scale

EFFECT = DriveEffect(
    name="gain_error",
    title="Wrong gain kp",
    law="u = kp_scale kp (command - q) - kd dq",
    parameter="kp_scale",
    unit="-",
    moves=((KP_SCALE, 1.0),),
    scale=Scale.ONE,
    healthy=0.03,
    smallest=0.08,
    largest=0.9,
    two_sided=True,
    confused_with=("torque_constant_error", "armature"),
    experiment="a known mass put on, and the command held at several poses",
)
