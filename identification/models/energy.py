"""The energy identification model: what the drives put in over an interval is stored or dissipated.

Gautier & Khalil (1988), "On the identification of the inertial parameters of robots": the integral
of dq'(tau - friction) over an interval equals the change of h beta. Nothing is differentiated but
the position, once. Intervals overlap; one starts at every decimated sample.
"""

import numpy as np
from numpy.typing import NDArray

from ..base_parameters import BaseParameters
from ..chain import Chain
from ..energy import dissipation_regressor, energy_regressor, fourth_order
from ..filtering import decimation_step, edge_samples
from ..observations import Observations, Preprocessing
from ..signals import Signals

# An interval this many cut-off periods long: the average over it is the model's low-pass.
INTERVAL_PERIODS = 2.0


def equations(
    chain: Chain, base: BaseParameters, signals: Signals, preprocessing: Preprocessing, name: str
) -> Observations:
    """The energy balance of one run, one equation an interval, J, dated at the interval's middle.

    An interval during which all joints rest is unused.
    """
    rate, cutoff = signals.sample_rate, preprocessing.cutoff
    samples = len(signals.q)
    half = max(1, round(INTERVAL_PERIODS * rate / cutoff / 2))
    trim = max(signals.trim, edge_samples(rate, cutoff)) + half
    step = decimation_step(rate, cutoff)
    middle = np.arange(trim, samples - trim, step)
    first, last = middle - half, middle + half
    energy = energy_regressor(chain, signals.q, signals.dq, base.columns)
    dissipated = _integral(dissipation_regressor(chain, signals.dq, base.columns), rate)
    supplied = _integral(np.sum(signals.dq * signals.tau, axis=1, keepdims=True), rate)
    rows = energy[last] - energy[first] + dissipated[last] - dissipated[first]
    moving = np.any(np.abs(signals.dq) > preprocessing.dead_zone, axis=1, keepdims=True)
    moved = np.cumsum(moving, axis=0)
    return Observations(
        name=name,
        time=middle / rate,
        q=signals.q[middle],
        dq=signals.dq[middle],
        regressor=rows[:, None, :],
        torque=supplied[last] - supplied[first],
        used=moved[last] > moved[first],
        sample_rate=rate / step,
    )


def _integral(x: NDArray[np.float64], rate: float) -> NDArray[np.float64]:
    """Running integral along axis 0, zero at the start; same shape."""
    out = np.zeros_like(x)
    x = fourth_order(x)
    np.cumsum((x[1:] + x[:-1]) / (2 * rate), axis=0, out=out[1:])
    return out
