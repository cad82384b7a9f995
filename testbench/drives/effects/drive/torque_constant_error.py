"""The motor gives another torque for its current than the drive believes."""

from identification.output_error.plant import KD_SCALE, KP_SCALE

from ..base import DriveEffect, Scale

EFFECT = DriveEffect(
    name="torque_constant_error",
    title="Wrong torque constant",
    law="u = torque_scale (kp (command - q) - kd dq)",
    parameter="torque_scale",
    unit="-",
    moves=((KP_SCALE, 1.0), (KD_SCALE, 1.0)),
    scale=Scale.ONE,
    healthy=0.05,
    smallest=0.1,
    # Makers' constants hold to 10 to 30 %.
    largest=0.5,
    two_sided=True,
    confused_with=("gain_error",),
    experiment="a known mass put on, and the command held at several poses",
)
