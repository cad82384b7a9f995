"""The firmware rounds the command."""

from identification.output_error.plant import COMMAND_STEP

from ..base import DriveEffect, Scale

EFFECT = DriveEffect(
    name="command_quantisation",
    title="Command quantisation",
    law="the drive follows the nearest multiple of step",
    parameter="step",
    unit="rad",
    moves=((COMMAND_STEP, 1.0),),
    scale=Scale.ONE,
    # A 12-bit servo rounds to 1.5 mrad.
    healthy=0.0015,
    smallest=0.004,
    largest=0.1,
    whole_limb=True,
    smooth=False,
    confused_with=("deadband",),
    experiment="a slow ramp of the command at each joint",
)
