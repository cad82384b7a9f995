"""The drive does nothing about small position errors."""

from identification.output_error.plant import DEADBAND

from ..base import DriveEffect, Scale

EFFECT = DriveEffect(
    name="deadband",
    title="Deadband",
    law="u = kp (e - band sgn e) beyond |e| = band, nothing of e below",
    parameter="band",
    unit="rad",
    moves=((DEADBAND, 1.0),),
    scale=Scale.ONE,
    healthy=0.0005,
    smallest=0.002,
    largest=0.1,
    confused_with=("backlash", "coulomb_friction", "stiction"),
    experiment="slow reversals of small amplitude",
)
