"""The inverse dynamic identification model: tau = Y(q, dq, ddq) beta, n equations a sample.

Torque and every regressor column pass the same zero-phase low-pass before both are decimated
(parallel filtering, Gautier 1997), so the equation stays exact in the band that is kept. Near
rest the sign of the velocity, and with it Coulomb friction, is unknown: a joint's rows inside its
dead zone are marked unused.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .base_parameters import BaseParameters
from .chain import Chain
from .differentiation import differentiate
from .errors import InputError
from .filtering import decimation_step, edge_samples, zero_phase_lowpass
from .parameters import PER_JOINT, VISCOUS
from .regressor import regressor
from .signals import Motion, Signals

Array = NDArray[np.float64]

# The position keeps twice the band of the equations, so that its own filter leaves that band flat.
POSITION_BAND = 2.0
# Highest usable cut-off as a share of the sample rate.
HIGHEST_CUTOFF = 0.4


@dataclass(frozen=True)
class Preprocessing:
    """How logged signals become equations.

    cutoff: Hz, of the parallel low-pass on torque and regressor.
    differentiation: name of the method that finds velocity and acceleration.
    dead_zone: rad/s (m/s); rows of a joint slower than this are unused.
    """

    cutoff: float = 20.0
    differentiation: str = "rloess"
    dead_zone: float = 0.05

    def at(self, sample_rate: float) -> "Preprocessing":
        """The same with the cut-off lowered to what the sample rate carries."""
        cutoff = min(self.cutoff, HIGHEST_CUTOFF * sample_rate / POSITION_BAND)
        return Preprocessing(cutoff, self.differentiation, self.dead_zone)


@dataclass(frozen=True)
class Observations:
    """The identification equations of one run, M decimated samples of n joints.

    name: the run's. time: (M,) s from the run's start. q, dq: (M, n) filtered motion.
    regressor: (M, n, b). torque: (M, n) N·m. used: (M, n) bool, rows that take part.
    sample_rate: Hz, after decimation.
    """

    name: str
    time: Array
    q: Array
    dq: Array
    regressor: Array
    torque: Array
    used: NDArray[np.bool_]
    sample_rate: float

    def residual(self, values: Array) -> Array:
        """torque - regressor @ values, (M, n) N·m."""
        return self.torque - self.regressor @ values


def observe(
    chain: Chain, base: BaseParameters, motion: Motion, preprocessing: Preprocessing, name: str = "run"
) -> Observations:
    """Filter one run and write its identification equations.

    Raises InputError when the run is too short for the filters or its shape is not the chain's.
    """
    if motion.position.shape[1] != chain.joints:
        raise InputError(name, "joint/position", f"{chain.joints} joints", motion.position.shape[1])
    settings = preprocessing.at(motion.sample_rate)
    signals = differentiate(motion, settings.differentiation, POSITION_BAND * settings.cutoff)
    return _equations(chain, base, signals, settings, name)


def _equations(
    chain: Chain, base: BaseParameters, signals: Signals, settings: Preprocessing, name: str
) -> Observations:
    rate, cutoff = signals.sample_rate, settings.cutoff
    samples = len(signals.q)
    trim = max(signals.trim, edge_samples(rate, cutoff))
    step = decimation_step(rate, cutoff)
    kept = slice(trim, samples - trim, step)
    rows = regressor(chain, signals.q, signals.dq, signals.ddq, base.columns)
    kept_rows = np.zeros((len(range(*kept.indices(samples))), chain.joints, base.count))
    link = base.columns // PER_JOINT
    for joint in range(chain.joints):
        # Links before the joint never load it: their columns are zero.
        loaded = link >= joint
        kept_rows[:, joint, loaded] = zero_phase_lowpass(rows[:, joint, loaded], rate, cutoff)[kept]
    friction = set(base.columns[base.columns % PER_JOINT > VISCOUS] // PER_JOINT)
    has_coulomb = np.array([joint in friction for joint in range(chain.joints)])
    return Observations(
        name=name,
        time=np.arange(samples)[kept] / rate,
        q=signals.q[kept],
        dq=signals.dq[kept],
        regressor=kept_rows,
        torque=zero_phase_lowpass(signals.tau, rate, cutoff)[kept],
        used=(np.abs(signals.dq[kept]) > settings.dead_zone) | ~has_coulomb,
        sample_rate=rate / step,
    )
