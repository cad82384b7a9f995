"""Coulomb friction beyond the model's."""

from identification.parameters import COULOMB

from ..base import DriveEffect, Scale

EFFECT = DriveEffect(
    name="coulomb_friction",
    title="More Coulomb friction",
    law="friction of fc against the motion, beyond what models usually miss",
    parameter="fc",
    unit="N·m",
    moves=((COULOMB, 1.0),),
    scale=Scale.TORQUE,
    healthy=0.02,
    smallest=0.05,
    largest=1.0,
    confused_with=("stiction", "load_dependent_friction", "deadband"),
    experiment="constant speeds, slow and fast, in both directions",
)
