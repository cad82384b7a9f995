"""Friction that grows with the load of the gearbox."""

from identification.output_error.plant import LOAD_FRICTION

from ..base import DriveEffect, Scale

EFFECT = DriveEffect(
    name="load_dependent_friction",
    title="Load-dependent friction",
    law="friction higher by coefficient times the torque that the gearbox carries",
    parameter="coefficient",
    unit="-",
    moves=((LOAD_FRICTION, 1.0),),
    scale=Scale.ONE,
    healthy=0.02,
    smallest=0.06,
    largest=0.7,
    confused_with=("coulomb_friction", "stiction"),
    experiment="the same speeds at two gravity poses",
)
