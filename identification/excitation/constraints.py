"""The limits as smooth functions of a sampled motion, with exact gradients, for the optimiser.

The largest of many ratios |x| / limit is replaced by the Kreisselmeier-Steinhauser function
(1/r) log sum exp(r x), which lies above it by at most log(count) / r and is smooth.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..chain import Chain
from ..inverse_dynamics import inverse_dynamics
from ..regressor_adjoint import regressor_adjoint
from ..springs import spring_stiffness
from .limits import Clearance, Limits

Array = NDArray[np.float64]
# Derivatives with respect to q, dq and ddq, each (T, n).
MotionGradient = tuple[Array, Array, Array]

SHARPNESS = 150.0
# Distances are compared in units of this, m, so that the sharpness resolves a few millimetres.
DISTANCE_SCALE = 0.5
# Samples of less weight than this are left out of a gradient.
NEGLIGIBLE = 1e-10
# Width of the smooth velocity reversal of Coulomb friction, rad/s (m/s).
COULOMB_VELOCITY = 0.1


@dataclass(frozen=True)
class SmoothConstraints:
    """What a motion must meet: ``values`` at least zero. All limits are relative to their bound.

    Ordered as position, velocity, acceleration and torque of every joint that has such a limit,
    then the clearance.
    """

    chain: Chain
    parameters: Array
    limits: Limits
    clearance: Clearance | None

    def values(self, q: Array, dq: Array, ddq: Array) -> Array:
        """Constraint values (K,) of a motion sampled at T instants, each (T, n)."""
        ratios = self._ratios(q, dq, ddq)
        parts = [1.0 - _smooth_largest(ratio)[0][joints] for ratio, joints in ratios]
        if self.clearance is not None:
            parts.append(np.array([self._clearance_value(self.clearance.distances(q))[0]]))
        return np.concatenate(parts)

    def gradients(self, q: Array, dq: Array, ddq: Array) -> list[MotionGradient]:
        """The K constraints' derivatives with respect to the motion."""
        ratios = self._ratios(q, dq, ddq)
        out: list[MotionGradient] = []
        zero = np.zeros(q.shape)
        half = (self.limits.upper - self.limits.lower) / 2
        for order, bound in enumerate((half, self.limits.velocity, self.limits.acceleration)):
            ratio, joints = ratios[order]
            weights = _smooth_largest(ratio)[1]
            for joint in joints:
                gradient = np.zeros(q.shape)
                gradient[:, joint] = -weights[:, joint] / bound[joint]
                motion = [zero, zero, zero]
                motion[order] = gradient
                out.append((motion[0], motion[1], motion[2]))
        ratio, joints = ratios[3]
        weights = _smooth_largest(ratio)[1]
        out += [self._torque_gradient(q, dq, ddq, int(joint), weights[:, joint]) for joint in joints]
        if self.clearance is not None:
            distances, gradients = self.clearance.gradients(q)
            pair_weights = self._clearance_value(distances)[1]
            out.append((np.einsum("tp,tpj->tj", pair_weights, gradients), zero, zero))
        return out

    def _ratios(self, q: Array, dq: Array, ddq: Array) -> list[tuple[Array, NDArray[np.int64]]]:
        """Position, velocity, acceleration, torque over their bounds (T, n), and the joints that have one."""
        limits = self.limits
        middle, half = (limits.upper + limits.lower) / 2, (limits.upper - limits.lower) / 2
        tau = inverse_dynamics(self.chain, self.parameters, q, dq, ddq, COULOMB_VELOCITY)
        pairs = (
            (q - middle, half),
            (dq, limits.velocity),
            (ddq, limits.acceleration),
            (tau, limits.torque),
        )
        return [(values / bound, np.flatnonzero(np.isfinite(bound))) for values, bound in pairs]

    def _torque_gradient(self, q: Array, dq: Array, ddq: Array, joint: int, weights: Array) -> MotionGradient:
        columns = np.flatnonzero(self.parameters)
        samples = np.flatnonzero(weights)
        seeds = np.zeros((len(samples), self.chain.joints, len(columns)))
        seeds[:, joint] = np.outer(-weights[samples] / self.limits.torque[joint], self.parameters[columns])
        motion = (q[samples], dq[samples], ddq[samples])
        bars = np.zeros((3, *q.shape))
        bars[:, samples] = regressor_adjoint(self.chain, *motion, seeds, columns, COULOMB_VELOCITY)
        stiffness = spring_stiffness(self.chain.springs, q[samples])[:, joint]
        bars[0, samples, joint] -= weights[samples] / self.limits.torque[joint] * stiffness
        return bars[0], bars[1], bars[2]

    def _clearance_value(self, distances: Array) -> tuple[float, Array]:
        """The smooth smallest distance less the required one, over DISTANCE_SCALE; its derivative (T, P)."""
        required = 0.0 if self.clearance is None else self.clearance.required
        smallest = distances.min()
        powers = np.exp(-SHARPNESS / DISTANCE_SCALE * (distances - smallest))
        total = powers.sum()
        value = (smallest - required) / DISTANCE_SCALE - np.log(total) / SHARPNESS
        return float(value), powers / total / DISTANCE_SCALE


def _smooth_largest(ratios: Array) -> tuple[Array, Array]:
    """Smooth max over time of |ratios| (T, n), shape (n,), and its derivative (T, n)."""
    top = np.abs(ratios).max(axis=0)
    above, below = np.exp(SHARPNESS * (ratios - top)), np.exp(-SHARPNESS * (ratios + top))
    total = (above + below).sum(axis=0)
    weights = (above - below) / total
    weights[np.abs(weights) < NEGLIGIBLE] = 0.0
    return top + np.log(total) / SHARPNESS, weights
