"""The command reaches the drive late."""

from identification.output_error.plant import DELAY

from ..base import DriveEffect, Scale

EFFECT = DriveEffect(
    name="command_delay",
    title="Command delay",
    law="the drive follows command(t - delay)",
    parameter="delay",
    unit="s",
    moves=((DELAY, 1.0),),
    scale=Scale.ONE,
    healthy=0.003,
    smallest=0.006,
    largest=0.1,
    whole_limb=True,
    confused_with=("damping_gain_error", "viscous_friction", "command_rate_limit"),
    experiment="a chirp of the command up to where the joint hardly follows",
)
