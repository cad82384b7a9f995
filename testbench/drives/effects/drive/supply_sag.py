"""The supply drops while the drives together give much torque."""

from identification.output_error.plant import SAG

from ..base import DriveEffect, Scale

EFFECT = DriveEffect(
    name="supply_sag",
    title="Supply sag",
    law="every torque is less by sag times the sum of all drives' |torque|",
    parameter="sag",
    unit="1/(N·m)",
    moves=((SAG, 1.0),),
    scale=Scale.PER_TOTAL,
    healthy=0.01,
    smallest=0.05,
    largest=0.7,
    whole_limb=True,
    only_whole=True,
    confused_with=("torque_constant_error", "torque_limit"),
    experiment="one joint's motion alone, and again while the others work",
)
