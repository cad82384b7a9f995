"""The source's own pipeline: zero-phase Butterworth, central differences, RLOESS on the acceleration.

Jin & Gans (2015), "Parameter identification for industrial robots with a fast and robust
trajectory design approach", section on data processing.
"""

from dataclasses import replace

from ..rloess import rloess
from ..signals import Motion, Signals
from . import butterworth_central

# The window spans this share of a cut-off period, so that RLOESS smooths what the filter let pass.
WINDOW_PERIODS = 0.5


def differentiate(motion: Motion, cutoff: float) -> Signals:
    """As butterworth_central, with the acceleration smoothed by RLOESS over half a cut-off period."""
    signals = butterworth_central.differentiate(motion, cutoff)
    window = 2 * round(WINDOW_PERIODS * motion.sample_rate / cutoff / 2) + 1
    return replace(signals, ddq=rloess(signals.ddq, window))
