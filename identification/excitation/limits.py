"""The limits a motion must keep, and by how much it keeps them on a fine grid of time."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ..chain import Chain
from ..errors import InputError
from ..inverse_dynamics import inverse_dynamics
from ..parameters import COULOMB, PER_JOINT
from .trajectory import Trajectory

Array = NDArray[np.float64]

FINE_RATE = 1000.0
FINE_SAMPLES_PER_PERIOD = 20


class Limits(Protocol):
    """What n joints may do, each (n,) at the joint, inf for none.

    lower, upper: position, rad (m). velocity: rad/s. acceleration: rad/s². torque: N·m (N).
    """

    @property
    def lower(self) -> Array:
        """Smallest positions."""
        ...

    @property
    def upper(self) -> Array:
        """Largest positions."""
        ...

    @property
    def velocity(self) -> Array:
        """Largest speeds."""
        ...

    @property
    def acceleration(self) -> Array:
        """Largest accelerations."""
        ...

    @property
    def torque(self) -> Array:
        """Largest torques."""
        ...


@dataclass(frozen=True)
class JointLimits:
    """Limits as plain arrays (n,); implements ``Limits``."""

    lower: Array
    upper: Array
    velocity: Array
    acceleration: Array
    torque: Array


def share_of(limits: Limits, share: float) -> JointLimits:
    """The limits with every range and bound multiplied by ``share``, ranges about their middle."""
    middle, half = (limits.lower + limits.upper) / 2, share * (limits.upper - limits.lower) / 2
    return JointLimits(
        middle - half,
        middle + half,
        share * limits.velocity,
        share * limits.acceleration,
        share * limits.torque,
    )


class Clearance(Protocol):
    """Distances between P pairs of bodies of the robot and its surroundings, along configurations.

    Distances beyond ``required`` by more than some reach may be given as that reach.
    """

    @property
    def required(self) -> float:
        """Smallest distance allowed, m."""
        ...

    @property
    def pairs(self) -> tuple[str, ...]:
        """P names, for messages."""
        ...

    def distances(self, q: Array) -> Array:
        """Signed distances (N, P) m at the configurations (N, n)."""
        ...

    def gradients(self, q: Array) -> tuple[Array, Array]:
        """Signed distances (N, P) m, and their derivatives with respect to q, (N, P, n)."""
        ...


@dataclass(frozen=True)
class MotionPeaks:
    """Largest absolute values of a motion on the fine grid, each (n,): rad/s, rad/s², N·m (m/s, m/s², N)."""

    velocity: Array
    acceleration: Array
    torque: Array


@dataclass(frozen=True)
class LimitMargins:
    """What is left to each limit on the fine grid; negative where a limit is broken.

    position: (n,) rad (m), to the nearer end of the range. velocity: (n,) rad/s. acceleration: (n,)
    rad/s². torque: (n,) N·m (N). inf where there is no limit. clearance: m beyond the required
    distance, or None where no clearance was asked for. rate: Hz of the grid. peaks: the motion's own.
    """

    position: Array
    velocity: Array
    acceleration: Array
    torque: Array
    clearance: float | None
    rate: float
    peaks: MotionPeaks

    @property
    def kept(self) -> bool:
        """Whether every limit is kept."""
        joints = (self.position, self.velocity, self.acceleration, self.torque)
        return all(np.all(margin >= 0) for margin in joints) and (
            self.clearance is None or self.clearance >= 0
        )


def limit_margins(
    chain: Chain,
    parameters: Array,
    limits: Limits,
    trajectory: Trajectory,
    clearance: Clearance | None = None,
) -> LimitMargins:
    """Margins of one period at 1 kHz, or at 20 points per period of its fastest content if that is more.

    Torque is that of the given standard parameters (14 n,), with exact Coulomb friction.
    """
    rate = max(FINE_RATE, FINE_SAMPLES_PER_PERIOD * trajectory.highest_frequency)
    time = np.arange(np.ceil(trajectory.duration * rate) + 1) / rate
    q, dq, ddq = trajectory.evaluate(time)
    tau = inverse_dynamics(chain, parameters, q, dq, ddq)
    peaks = MotionPeaks(*(np.abs(values).max(axis=0) for values in (dq, ddq, tau)))
    return LimitMargins(
        position=np.minimum(q - limits.lower, limits.upper - q).min(axis=0),
        velocity=limits.velocity - peaks.velocity,
        acceleration=limits.acceleration - peaks.acceleration,
        torque=limits.torque - peaks.torque,
        clearance=None if clearance is None else float(clearance.distances(q).min() - clearance.required),
        rate=rate,
        peaks=peaks,
    )


def holding_torque(chain: Chain, parameters: Array, q: Array) -> Array:
    """Largest torque (N, n) near rest at the configurations (N, n): gravity and Coulomb friction."""
    rest = np.zeros(q.shape)
    coulomb = np.abs(parameters.reshape(-1, PER_JOINT)[: chain.joints, COULOMB])
    return np.abs(inverse_dynamics(chain, parameters, q, rest, rest)) + coulomb


def missing_limits(limits: Limits) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Which joints (n,) have no range of position, and which neither a torque limit nor the two of speed."""
    no_range = ~(np.isfinite(limits.lower) & np.isfinite(limits.upper))
    no_bound = ~np.isfinite(limits.torque) & ~np.isfinite(limits.velocity + limits.acceleration)
    return no_range, no_bound


def require_usable(chain: Chain, limits: Limits) -> None:
    """Raise InputError unless the limits are positive and bound every joint's motion.

    Every joint needs a finite position range, and a finite torque limit or else finite velocity and
    acceleration limits.
    """
    no_range, no_bound = missing_limits(limits)
    for joint, name in enumerate(chain.joint_names):
        lower, upper = float(limits.lower[joint]), float(limits.upper[joint])
        if no_range[joint]:
            raise InputError("limits", f"position range of {name}", "finite bounds", f"{lower} to {upper}")
        if not lower < upper:
            raise InputError("limits", f"position range of {name}", "lower < upper", f"{lower} to {upper}")
        bounds = {
            "velocity": float(limits.velocity[joint]),
            "acceleration": float(limits.acceleration[joint]),
            "torque": float(limits.torque[joint]),
        }
        for kind, bound in bounds.items():
            if not bound > 0:
                raise InputError("limits", f"{kind} limit of {name}", "a positive number", bound)
        if no_bound[joint]:
            expected = "a finite value, or finite velocity and acceleration limits instead"
            raise InputError("limits", f"torque limit of {name}", expected, "none")
