"""Friction that is higher at one end of a joint's motion than at the other."""

from identification.output_error.plant import FRICTION_SLOPE

from ..base import DriveEffect, Scale

EFFECT = DriveEffect(
    name="position_dependent_friction",
    title="Friction that changes with position",
    law="Coulomb friction higher by slope (q - middle of the motion), nowhere below zero",
    parameter="slope",
    unit="N·m/rad",
    moves=((FRICTION_SLOPE, 1.0),),
    scale=Scale.TORQUE_SLOPE,
    healthy=0.02,
    smallest=0.04,
    largest=1.0,
    two_sided=True,
    confused_with=("load_dependent_friction", "coulomb_friction"),
    experiment="one slow speed over the whole range, both ways",
)
