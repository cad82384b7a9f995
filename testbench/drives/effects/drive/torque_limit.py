"""The drive gives less torque than its stated limit."""

from identification.output_error.plant import LIMIT

from ..base import DriveEffect, Law, Scale

EFFECT = DriveEffect(
    name="torque_limit",
    title="Lower torque limit",
    law="|u| <= limit, below what the stated law reaches in these runs",
    parameter="limit",
    unit="N·m",
    moves=((LIMIT, -1.0),),
    scale=Scale.PEAK_TORQUE,
    healthy=0.01,
    smallest=0.05,
    largest=0.9,
    laws=(Law("", ((LIMIT, 1.0, Scale.PEAK_TORQUE),)),),
    confused_with=("supply_sag", "command_rate_limit"),
    experiment="fast large motions, one joint at a time",
)
