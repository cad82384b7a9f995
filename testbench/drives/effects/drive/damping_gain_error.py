"""The velocity gain is not the stated one."""

from identification.output_error.plant import KD_SCALE

from ..base import DriveEffect, Scale

EFFECT = DriveEffect(
    name="damping_gain_error",
    title="Wrong gain kd",
    law="u = kp (command - q) - kd_scale kd dq",
    parameter="kd_scale",
    unit="-",
    moves=((KD_SCALE, 1.0),),
    scale=Scale.ONE,
    healthy=0.05,
    smallest=0.15,
    largest=0.95,
    two_sided=True,
    confused_with=("viscous_friction", "command_delay"),
    experiment="the same motion at another stated kd",
)
