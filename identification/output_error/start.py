"""Where the fit of the simulated motion starts: a regression of the drives' law on the regressor.

Both sides are low-passed far below where encoder noise rules the derivatives, so that what it adds to the
regressor's columns is small; what bias is left the simulation takes away. The gains are taken as stated:
free, they would all go to zero together with the inertias.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from ..chain import Chain
from ..filtering import central_difference, decimation_step, edge_samples, zero_phase_lowpass
from ..parameters import COULOMB, PER_JOINT
from ..regressor import regressor
from .plant import DELAY, LIMIT
from .servo_run import ServoRun
from .unknowns import Unknowns

Array = NDArray[np.float64]

# Hz, and share of the sample rate.
CUTOFF, CUTOFF_SHARE = 8.0, 0.1
# Of a joint's RMS speed: slower, the sign of the velocity is not known.
SLOW = 0.1
# Delays that are tried, from the lowest to the highest.
DELAYS = 21
# Share of a joint's torque that the law misses, and for how many independent samples a second counts.
MISFIT, PER_SECOND = 0.1, 2.0
# What the equations leave as it is stated.
AS_STATED = ("kp_scale", "kd_scale", "delay", "limit")


def regression_start(chain: Chain, unknown: Unknowns, runs: Sequence[ServoRun]) -> Array:
    """Values (m,) of the unknowns at which the drives' torque along the measured motion is the model's.

    Each joint's delay is the one of a grid by which its own equations are met best.
    """
    equations = _Equations(chain, unknown, runs)
    values, delays = unknown.held(unknown.mean), unknown.at("delay")
    if len(delays):
        span = unknown.upper[delays] - unknown.lower[delays]
        trials = [unknown.lower[delays] + share * span for share in np.linspace(0, 1, DELAYS)]
        misfits = []
        for trial in trials:
            values[delays] = trial
            misfits.append(equations.solved(values)[1][unknown.joints[delays]])
        values[delays] = np.array(trials)[np.argmin(misfits, axis=0), np.arange(len(delays))]
    return unknown.held(equations.solved(values)[0])


class _Motion:
    """A run's smoothed motion at a slower rate, and its regressor (M, n, n, 14)."""

    def __init__(self, chain: Chain, run: ServoRun):
        rate = run.rate
        cutoff = min(CUTOFF, CUTOFF_SHARE * rate)
        self._position = zero_phase_lowpass(run.position, rate, cutoff)
        velocity = central_difference(self._position, rate)
        acceleration = central_difference(velocity, rate)
        edge = min(edge_samples(rate, cutoff), len(velocity) // 4)
        self._run, self._cutoff = run, cutoff
        self._kept = slice(edge, len(velocity) - edge, decimation_step(rate, cutoff))
        position, self._velocity, acceleration = (
            each[self._kept] for each in (self._position, velocity, acceleration)
        )
        self.duration = len(velocity) / rate
        shape = (len(position), chain.joints, chain.joints, PER_JOINT)
        self.regressor = regressor(chain, position, self._velocity, acceleration).reshape(shape)
        slow = SLOW * np.sqrt(np.mean(self._velocity**2, axis=0)) + 1e-12
        own = np.arange(chain.joints)
        self.regressor[:, own, own, COULOMB] = np.tanh(self._velocity / slow)

    def law(self, table: Array) -> Array:
        """The drives' torque as stated, (M, n) N·m."""
        run, out = self._run, np.empty_like(self._velocity)
        time = np.arange(len(run.command)) / run.rate
        for joint, (delay, limit) in enumerate(table[:, [DELAY, LIMIT]]):
            # A held command is half a sample late on the whole.
            command = np.interp(time - delay - 0.5 / run.rate, time, run.command[:, joint])
            error = zero_phase_lowpass(command, run.rate, self._cutoff) - self._position[:, joint]
            torque = run.kp[joint] * error[self._kept] - run.kd[joint] * self._velocity[:, joint]
            out[:, joint] = np.clip(torque, -limit, limit)
        return out


class _Equations:
    """sum_k x_k Y basis_k = u - Y origin for all runs, u the law's torque, each joint's at its own scale."""

    def __init__(self, chain: Chain, unknown: Unknowns, runs: Sequence[ServoRun]):
        self._unknown = unknown
        self._motions = [_Motion(chain, run) for run in runs]
        self._free = np.array([place for place, name in enumerate(unknown.names) if name not in AS_STATED])
        law = self._law(unknown.held(unknown.mean))
        duration = sum(motion.duration for motion in self._motions)
        share = np.sqrt(PER_SECOND * duration / len(law))
        self._weights = share / (MISFIT * np.sqrt(np.mean(law**2, axis=0)) + 1e-12)
        regressors = np.concatenate([motion.regressor for motion in self._motions])
        basis = unknown.basis[self._free][..., :PER_JOINT]
        regressors = regressors.reshape(len(law), chain.joints, -1)
        rows = regressors @ basis.reshape(len(basis), -1).T
        self._origin = regressors @ unknown.origin[:, :PER_JOINT].ravel()
        self._rows = rows * unknown.deviation[self._free] * self._weights[:, None]
        flat = np.vstack([self._rows.reshape(-1, len(self._free)), np.eye(len(self._free))])
        self._q, self._r = np.linalg.qr(flat)

    def _law(self, values: Array) -> Array:
        table = self._unknown.table(values)
        return np.concatenate([motion.law(table) for motion in self._motions])

    def solved(self, values: Array) -> tuple[Array, Array]:
        """Values with the free ones solved for, and the weighted RMS misfit (n,)."""
        unknown, free = self._unknown, self._free
        mean, deviation = unknown.mean[free], unknown.deviation[free]
        wanted = (self._law(values) - self._origin) * self._weights
        wanted = wanted - self._rows @ (mean / deviation)
        lower, upper = ((each[free] - mean) / deviation for each in (unknown.lower, unknown.upper))
        rotated = self._q.T @ np.append(wanted.ravel(), np.zeros(len(free)))
        found = lsq_linear(self._r, rotated, (lower - 1e-9, upper + 1e-9)).x
        out = values.copy()
        out[free] = mean + found * deviation
        return out, np.sqrt(np.mean((self._rows @ found - wanted) ** 2, axis=0))
