"""Torque of which only the size was logged: its sign is the likeliest by the robot's law.

With size y = |tau + e|, tau = Y theta and e of deviation s, the sign is that of Y theta with probability
(1 + tanh(y Y theta / s²)) / 2. Expectation and maximisation take turns: the expected sign by the current
theta, and theta by the torque that has it, theta held about the model by its prior (Dempster, Laird & Rubin,
"Maximum Likelihood from Incomplete Data via the EM Algorithm", J. R. Statist. Soc. B 39, 1977). Where the
sign is not clear the expected torque is near zero, and so is what was logged.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .chain import Chain
from .covariance import variance_inflation
from .filtering import central_difference, edge_samples, zero_phase_lowpass
from .inverse_dynamics import inverse_dynamics
from .parameters import COULOMB, PER_JOINT
from .prior import parameter_widths
from .regressor import regressor

Array = NDArray[np.float64]

# Hz, and share of the sample rate: the motion is low-passed there, as far as encoders let it.
CUTOFF, CUTOFF_SHARE = 8.0, 0.1
# Samples that theta is fitted to at most.
MOST = 3000
# Of a joint's RMS speed: slower, the sign of its friction is not known.
SLOW = 0.1
# Coulomb friction that the search begins from, as shares of a joint's torque: the model's, or more.
STARTS = (0.0, 0.5)
# Turns at most, and the change of an expected sign that ends them.
TURNS, SETTLED = 200, 1e-3
# Expected sign from which it is clear: right in 39 cases of 40.
CLEAR = 0.95


@dataclass(frozen=True)
class Signs:
    """Expected signs (N, n) of a run's torque, from -1 to 1.

    clear: (n,) share of each joint's mean square torque whose sign is clear.
    """

    expected: Array
    clear: Array


def likeliest_signs(chain: Chain, parameters: Array, q: Array, rate: float, size: Array) -> Signs:
    """The signs of a torque of size (N, n) N·m along positions q (N, n) rad, at a rate in Hz.

    parameters: (14 links,) of the model.
    """
    cutoff = min(CUTOFF, CUTOFF_SHARE * rate)
    position = zero_phase_lowpass(q, rate, cutoff)
    velocity = central_difference(position, rate)
    motion = position, velocity, central_difference(velocity, rate)
    edge = min(edge_samples(rate, cutoff), len(q) // 4)
    kept = slice(edge, len(q) - edge, max(1, len(q) // MOST))
    problem = _Problem(chain, parameters, [each[kept] for each in motion], size[kept])
    found = [problem.solved(problem.start(share)) for share in STARTS]
    theta, std, _ = min(found, key=lambda each: each[2])
    slow = problem.slow
    predicted = inverse_dynamics(chain, _without_coulomb(theta), *motion)
    predicted += theta.reshape(-1, PER_JOINT)[: chain.joints, COULOMB] * np.tanh(velocity / slow)
    expected = np.tanh(size * predicted / std**2)
    squares = np.sum(size**2, axis=0)
    clear = np.sum(np.where(np.abs(expected) >= CLEAR, size, 0.0) ** 2, axis=0)
    return Signs(expected, np.where(squares > 0, clear / np.maximum(squares, np.finfo(float).tiny), 1.0))


class _Problem:
    """Sizes of torque along a motion, and the prior of what makes them."""

    def __init__(self, chain: Chain, parameters: Array, motion: list[Array], size: Array):
        position, velocity, acceleration = motion
        scale, speed, rate_of_speed = (
            np.sqrt(np.mean(each**2, axis=0)) + 1e-9 for each in (size, velocity, acceleration)
        )
        self._size, self._nominal, self._scale, self.slow = size, parameters, scale, SLOW * speed
        self._widths = parameter_widths(parameters, scale, speed, rate_of_speed)
        rows = regressor(chain, position, velocity, acceleration).reshape(*size.shape, chain.links, PER_JOINT)
        own = np.arange(chain.joints)
        rows[:, own, own, COULOMB] = np.tanh(velocity / self.slow)
        self._rows = rows.reshape(*size.shape, -1)
        self._grams = np.einsum("tja,tjb->jab", self._rows, self._rows, optimize=True)

    def start(self, share: float) -> Array:
        """The model's parameters, with Coulomb friction of at least a share of each joint's torque."""
        out = self._nominal.copy().reshape(-1, PER_JOINT)
        own = slice(len(self._scale))
        out[own, COULOMB] = np.maximum(out[own, COULOMB], share * self._scale)
        return out.ravel()

    def solved(self, theta: Array) -> tuple[Array, Array, float]:
        """Parameters (14 links,), deviations (n,) of the torque, and minus log-likelihood and prior."""
        size, rows, widths = self._size, self._rows, self._widths
        torque = rows @ theta
        std = np.sqrt(np.mean((size - np.abs(torque)) ** 2, axis=0)) + 1e-9 * self._scale
        expected, inflation = np.zeros_like(size), np.ones(size.shape[1])
        for _ in range(TURNS):
            before, expected = expected, np.tanh(size * torque / std**2)
            if np.abs(expected - before).max() < SETTLED:
                break
            # A slow misfit counts for few samples, and leaves theta to the prior.
            residual = expected * size - torque
            inflation = variance_inflation([residual], [np.ones(size.shape, dtype=bool)])[1]
            weights = 1 / (std**2 * inflation)
            matrix = np.diag(widths**-2.0) + np.einsum("jab,j->ab", self._grams, weights)
            misfit = (expected * size - rows @ self._nominal) * weights
            slope = np.einsum("tja,tj->a", rows, misfit, optimize=True)
            theta = self._nominal + np.linalg.solve(matrix, slope)
            torque = rows @ theta
            squares = size**2 - 2 * expected * size * torque + torque**2
            std = np.sqrt(np.mean(squares, axis=0)) + 1e-9 * self._scale
        either = np.logaddexp(-0.5 * ((size - torque) / std) ** 2, -0.5 * ((size + torque) / std) ** 2)
        held = 0.5 * float(np.sum(((theta - self._nominal) / widths) ** 2))
        cost = float(np.sum((np.log(std) - either) / inflation)) + held
        return theta, std, cost


def _without_coulomb(theta: Array) -> Array:
    out = theta.copy().reshape(-1, PER_JOINT)
    out[:, COULOMB] = 0.0
    return out.ravel()
