"""Feasible motions drawn at random: starting points of a design, and runs for validation."""

from collections import Counter
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..chain import Chain
from ..errors import InputError
from ..inverse_dynamics import inverse_dynamics
from .limits import Clearance, Limits, holding_torque, limit_margins
from .problem import sampling_times
from .trajectory import Trajectory, TrajectoryBasis

Array = NDArray[np.float64]

CONFIGURATIONS = 1024
# Centres are drawn from this share of every joint's range, to leave room for the motion.
CENTRE_SHARE = 0.5
SHRINK, GROW, GROW_ROUNDS = 0.85, 1.2, 8
# A motion that must be shrunk below this share to keep the limits is given up, after so many draws.
SMALLEST_FACTOR, DRAWS = 0.02, 20
REPAIR_STEP = 0.99
# Kept free on the coarse grid, for what happens between its instants.
RESERVE = 0.97


@dataclass(frozen=True)
class FeasibleMotions:
    """Draws random motions of a chain that keep its limits.

    limits: those to keep. centres: (K, n) configurations in which the arm can rest.
    """

    chain: Chain
    parameters: Array
    limits: Limits
    basis: TrajectoryBasis[Any]
    clearance: Clearance | None
    centres: Array

    def draw(self, rng: np.random.Generator) -> Array:
        """Free coefficients (size, n) of one motion, as large as the limits let all joints be together.

        Raises InputError, naming the limit that stops most motions, where there is no room to move.
        """
        stopped = Counter[str]()
        for _ in range(DRAWS):
            centre = self.centres[rng.integers(len(self.centres))]
            coefficients = np.vstack([centre, rng.normal(size=(self.basis.size - 1, self.chain.joints))])
            coefficients[1:] *= self._largest_alone(coefficients)
            factor, stop = 1.0, ""
            while factor > SMALLEST_FACTOR:
                broken = self._broken(_scaled(coefficients, factor))
                if broken is None:
                    return _scaled(coefficients, factor)
                factor, stop = factor * SHRINK, broken
            stopped[stop] += 1
        ((field, _),) = stopped.most_common(1)
        room = "room to move about a configuration of rest"
        expected = (
            f"{room}; a smaller --clearance, or joints held still (--joints with the others), may give it"
        )
        raise InputError("limits", field, expected, f"none in {DRAWS} random motions")

    def enlarged(self, coefficients: Array) -> Array:
        """The motion with every joint's amplitude enlarged in turn as far as the limits allow."""
        room = self._largest_alone(coefficients)
        factors = np.ones(self.chain.joints)
        for _ in range(GROW_ROUNDS):
            for joint in range(self.chain.joints):
                trial = factors.copy()
                trial[joint] = min(GROW * trial[joint], room[joint])
                if trial[joint] > factors[joint] and self._broken(_scaled(coefficients, trial)) is None:
                    factors = trial
        return _scaled(coefficients, factors)

    def repaired(self, series: Trajectory) -> Trajectory | None:
        """The motion shrunk about its centre until every limit is kept on the fine grid.

        None where only next to a standstill would keep them.
        """
        factor = 1.0
        while factor > SMALLEST_FACTOR:
            trial = series.scaled(factor)
            if limit_margins(self.chain, self.parameters, self.limits, trial, self.clearance).kept:
                return trial
            factor *= REPAIR_STEP
        return None

    def _largest_alone(self, coefficients: Array) -> Array:
        """Factors (n,) by which each joint's amplitude may grow before its own motion meets a limit."""
        q, dq, ddq = (matrix @ coefficients for matrix in self.basis.matrices(sampling_times(self.basis)))
        centre, limits = coefficients[0], self.limits
        factors = [
            _room(limits.upper - centre, (q - centre).max(axis=0)),
            _room(centre - limits.lower, (centre - q).max(axis=0)),
            _room(limits.velocity, np.abs(dq).max(axis=0)),
            _room(limits.acceleration, np.abs(ddq).max(axis=0)),
        ]
        return RESERVE * np.min(factors, axis=0)

    def _broken(self, coefficients: Array) -> str | None:
        """The limit of torque or clearance that is broken most on a coarse grid; None where all are kept."""
        q, dq, ddq = (matrix @ coefficients for matrix in self.basis.matrices(sampling_times(self.basis)))
        tau = inverse_dynamics(self.chain, self.parameters, q, dq, ddq)
        excess = np.abs(tau).max(axis=0) - RESERVE * self.limits.torque
        if np.any(excess > 0):
            return f"torque limit of {self.chain.joint_names[int(np.argmax(excess))]}"
        if self.clearance is None:
            return None
        nearest = self.clearance.distances(q).min(axis=0, initial=np.inf)
        if np.all(nearest >= self.clearance.required):
            return None
        return f"clearance of {self.clearance.pairs[int(np.argmin(nearest))]}"


def resting_centres(
    chain: Chain, parameters: Array, limits: Limits, clearance: Clearance | None, seed: int
) -> Array:
    """Configurations (K, n) in which the arm can rest: about the middle of its range, else anywhere in it.

    Raises InputError that names the limit which forbids rest, and what would satisfy it.
    """
    rng = np.random.default_rng(seed)
    middle, half = (limits.lower + limits.upper) / 2, (limits.upper - limits.lower) / 2
    for share in (CENTRE_SHARE, 1.0):
        q = middle + share * half * rng.uniform(-1, 1, (CONFIGURATIONS, chain.joints))
        torque = holding_torque(chain, parameters, q)
        shortage = torque - limits.torque
        if clearance is not None:
            distances = clearance.distances(q)
            shortage = np.hstack([shortage, clearance.required - distances])
        possible = np.all(shortage <= 0, axis=1)
        if possible.any():
            return q[possible]
    worst = int(np.argmax((shortage > 0).mean(axis=0)))
    if clearance is None or worst < chain.joints:
        field = f"torque limit of {chain.joint_names[worst]} times limit_share"
        least = f"at least {torque[:, worst].min():.4g} to hold the arm still"
        expected = f"{least}, or this joint held still (--joints with the others)"
        raise InputError("limits", field, expected, f"{limits.torque[worst]:.4g}")
    pair = worst - chain.joints
    expected = f"at most {distances[:, pair].max():.4g} m, the largest in {CONFIGURATIONS} configurations"
    raise InputError(
        "limits", f"clearance of {clearance.pairs[pair]}", expected, f"{clearance.required:.4g} m"
    )


def _room(bound: Array, extent: Array) -> Array:
    """bound / extent (n,), inf where the extent is no more than rounding."""
    moving = extent > np.finfo(float).eps
    return np.divide(bound, extent, out=np.full(bound.shape, np.inf), where=moving)


def _scaled(coefficients: Array, factor: float | Array) -> Array:
    return np.vstack([coefficients[:1], factor * coefficients[1:]])
