"""Play between motor and link."""

from identification.output_error.plant import ENCODER_AFTER, GAP

from ..base import DriveEffect, Law, Scale

EFFECT = DriveEffect(
    name="backlash",
    title="Backlash",
    law="the motor moves its link only at the ends of a play of gap",
    parameter="gap",
    unit="rad",
    moves=((GAP, 1.0),),
    scale=Scale.ONE,
    healthy=0.001,
    smallest=0.003,
    largest=0.06,
    laws=(
        Law("encoder at the motor"),
        Law("encoder at the link", ((ENCODER_AFTER, 1.0, Scale.ONE),)),
    ),
    confused_with=("deadband", "stiction", "coulomb_friction"),
    experiment="slow reversals of small amplitude, the link's weight on one side and then on the other",
)
