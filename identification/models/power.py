"""The power identification model: dq'tau = d/dt (h beta) + dissipation, one equation a sample.

Gautier (1997), "Dynamic identification of robots with power model": both sides pass the same
first-order filter a / (s + a), so that h, which needs no acceleration, is differentiated by the
filter alone, as a s / (s + a) h. Both are then low-passed and decimated in parallel.
"""

import numpy as np
from numpy.typing import NDArray
from scipy import signal

from ..base_parameters import BaseParameters
from ..chain import Chain
from ..energy import dissipation_regressor, energy_regressor, fourth_order
from ..filtering import decimation_step, edge_samples, zero_phase_lowpass
from ..observations import Observations, Preprocessing
from ..signals import Signals


def equations(
    chain: Chain, base: BaseParameters, signals: Signals, preprocessing: Preprocessing, name: str
) -> Observations:
    """The power balance of one run, one equation a decimated sample, W; unused where all joints rest."""
    rate, cutoff = signals.sample_rate, preprocessing.cutoff
    samples = len(signals.q)
    energy = energy_regressor(chain, signals.q, signals.dq, base.columns)
    # The bilinear transform integrates by the trapezoidal rule.
    dissipated = fourth_order(dissipation_regressor(chain, signals.dq, base.columns))
    power = fourth_order(np.sum(signals.dq * signals.tau, axis=1, keepdims=True))
    corner = 2 * np.pi * cutoff
    smooth = signal.bilinear([corner], [1, corner], rate)
    slope = signal.bilinear([corner, 0], [1, corner], rate)
    rows = _from_rest(slope, energy - energy[0]) + _from_rest(smooth, dissipated)
    supplied = _from_rest(smooth, power)
    trim = max(signals.trim, edge_samples(rate, cutoff))
    step = decimation_step(rate, cutoff)
    kept = slice(trim, samples - trim, step)
    dq = signals.dq[kept]
    return Observations(
        name=name,
        time=np.arange(samples)[kept] / rate,
        q=signals.q[kept],
        dq=dq,
        regressor=zero_phase_lowpass(rows, rate, cutoff)[kept, None, :],
        torque=zero_phase_lowpass(supplied, rate, cutoff)[kept],
        used=np.any(np.abs(dq) > preprocessing.dead_zone, axis=1, keepdims=True),
        sample_rate=rate / step,
    )


def _from_rest(
    coefficients: tuple[NDArray[np.float64], NDArray[np.float64]], x: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Filter x along axis 0, output zero at the first sample: the same transient on both sides."""
    numerator, denominator = coefficients
    return signal.lfilter(numerator, denominator, x, axis=0, zi=-numerator[0] * x[:1])[0]
