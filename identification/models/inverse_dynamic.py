"""The inverse dynamic identification model: tau = Y(q, dq, ddq) beta, n equations a sample.

Torque and every regressor column pass the same zero-phase low-pass before both are decimated
(parallel filtering, Gautier 1997), so the equation stays exact in the band that is kept. Near
rest the sign of the velocity, and with it Coulomb friction, is unknown: a joint's rows inside its
dead zone are marked unused, and so are those within the filter's reach of such a moment.
"""

import numpy as np
from scipy.ndimage import maximum_filter1d

from ..base_parameters import BaseParameters
from ..chain import Chain
from ..filtering import decimation_step, edge_samples, zero_phase_lowpass
from ..observations import Observations, Preprocessing
from ..parameters import PER_JOINT, VISCOUS
from ..regressor import regressor
from ..signals import Signals

# Bytes of the regressor at the full rate that are filtered at once; more columns follow.
MOST_AT_ONCE = 1 << 28


def equations(
    chain: Chain, base: BaseParameters, signals: Signals, preprocessing: Preprocessing, name: str
) -> Observations:
    """The torque equations of one run, n a decimated sample, N·m (N for slide joints)."""
    rate, cutoff = signals.sample_rate, preprocessing.cutoff
    samples = len(signals.q)
    cutoffs = [preprocessing.cutoff_of(joint) for joint in range(chain.joints)]
    trim = max(signals.trim, *(edge_samples(rate, each) for each in cutoffs))
    step = decimation_step(rate, cutoff)
    kept = slice(trim, samples - trim, step)
    kept_rows = np.zeros((len(range(*kept.indices(samples))), chain.joints, base.count))
    at_once = max(1, MOST_AT_ONCE // signals.q.nbytes)
    for first in range(0, base.count, at_once):
        some = np.arange(first, min(first + at_once, base.count))
        rows = regressor(chain, signals.q, signals.dq, signals.ddq, base.columns[some])
        for joint, own in enumerate(cutoffs):
            # Links before the joint never load it: their columns are zero.
            loaded = base.columns[some] // PER_JOINT >= joint
            if not loaded.any():
                continue
            kept_rows[:, joint, some[loaded]] = zero_phase_lowpass(rows[:, joint, loaded], rate, own)[kept]
    torque = np.empty((len(kept_rows), chain.joints))
    resting = np.empty((samples, chain.joints), dtype=bool)
    for joint, own in enumerate(cutoffs):
        torque[:, joint] = zero_phase_lowpass(signals.tau[:, joint], rate, own)[kept]
        # A wrong sign near rest is smeared by the filter over about half a cut-off period to either side.
        reach = 2 * round(0.5 * rate / own) + 1
        slow = np.abs(signals.dq[:, joint]) <= preprocessing.dead_zone
        resting[:, joint] = maximum_filter1d(slow, reach)
    friction = set(base.columns[base.columns % PER_JOINT > VISCOUS] // PER_JOINT)
    has_coulomb = np.array([joint in friction for joint in range(chain.joints)])
    return Observations(
        name=name,
        time=np.arange(samples)[kept] / rate,
        q=signals.q[kept],
        dq=signals.dq[kept],
        regressor=kept_rows,
        torque=torque,
        used=~resting[kept] | ~has_coulomb,
        sample_rate=rate / step,
    )
