"""The rotor is heavier than the model's."""

from identification.parameters import ARMATURE

from ..base import DriveEffect, Scale

EFFECT = DriveEffect(
    name="armature",
    title="Larger rotor inertia",
    law="armature beyond what models usually miss",
    parameter="armature",
    unit="kg·m²",
    moves=((ARMATURE, 1.0),),
    scale=Scale.INERTIA,
    healthy=0.05,
    smallest=0.1,
    largest=5.0,
    confused_with=("gain_error", "command_delay"),
    experiment="a chirp of the command up to where the joint hardly follows",
)
