"""The firmware follows the command no faster than a speed."""

from identification.output_error.plant import INVERSE_RATE

from ..base import DriveEffect, Scale

EFFECT = DriveEffect(
    name="command_rate_limit",
    title="Command rate limit",
    law="the goal that the drive follows moves towards the command at rate at most",
    parameter="rate",
    unit="rad/s",
    moves=((INVERSE_RATE, 1.0),),
    # Limits above the fastest command do not show.
    scale=Scale.SLOWNESS,
    healthy=0.2,
    smallest=1.05,
    largest=20.0,
    inverse=True,
    whole_limb=True,
    confused_with=("command_delay", "torque_limit"),
    experiment="steps of the command of several heights",
)
