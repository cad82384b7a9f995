"""Viscous friction beyond the model's."""

from identification.parameters import VISCOUS

from ..base import DriveEffect, Scale

EFFECT = DriveEffect(
    name="viscous_friction",
    title="More viscous friction",
    law="friction of fv dq, beyond what models usually miss",
    parameter="fv",
    unit="N·m·s/rad",
    moves=((VISCOUS, 1.0),),
    scale=Scale.DAMPING,
    healthy=0.02,
    smallest=0.05,
    largest=1.0,
    confused_with=("damping_gain_error", "command_delay"),
    experiment="constant speeds, slow and fast, in both directions",
)
