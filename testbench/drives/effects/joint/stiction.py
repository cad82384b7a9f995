"""Friction that is higher near rest."""

from identification.output_error.plant import EXTRA, STRIBECK_VELOCITY

from ..base import DriveEffect, Law, Scale

EFFECT = DriveEffect(
    name="stiction",
    title="Stiction",
    law="friction higher by extra exp(-(v / velocity)²) near rest",
    parameter="extra",
    unit="N·m",
    moves=((EXTRA, 1.0),),
    scale=Scale.TORQUE,
    healthy=0.02,
    smallest=0.04,
    largest=1.0,
    laws=tuple(Law(f"{share:g}", ((STRIBECK_VELOCITY, share, Scale.SPEED),)) for share in (0.05, 0.2, 0.5)),
    confused_with=("coulomb_friction", "deadband", "backlash"),
    experiment="slow reversals of small amplitude",
)
