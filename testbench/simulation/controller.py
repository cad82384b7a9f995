"""The torque-level tracker: feedforward of the nominal model, and PD on the encoder.

    command = tau_ff + kp (q_ref - q) + kd (dq_ref - dq),   clipped to the nominal torque limits,

at ``rate``, held in between. q is the encoder's reading; dq is the backward difference of readings
through a first-order low-pass, dq_k = p dq_{k-1} + (1 - p) (q_k - q_{k-1}) rate, p = exp(-2 pi f_c / rate).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from identification.chain import Chain
from identification.errors import InputError
from identification.inverse_dynamics import inverse_dynamics
from identification.kinematics import kernel
from identification.parameters import ARMATURE, PER_JOINT
from identification.regressor import regressor

from .reference import Reference

Array = NDArray[np.float64]

KINDS = ("pd_with_model_feedforward", "pd")
# The servo of the model's position actuators, and its kind in logs.
MODEL, POSITION_SERVO = "model", "position_servo"
# Hz: of the velocity's low-pass, and of the loop up to which it holds.
VELOCITY_CUTOFF, USUAL_RATE = 80.0, 1000.0


@dataclass(frozen=True)
class ControllerOptions:
    """The tracker. Raises InputError for an unknown kind or a value out of range.

    kind: pd_with_model_feedforward, pd, or model (kp and kv of the model's position actuators, which damp
    the speed itself: kp (q_ref - q) - kv dq). rate: Hz. kp, kd: N·m/rad and N·m·s/rad (N/m, N·s/m), a
    scalar or one a joint; None: from the model by ``bandwidth`` (Hz) and ``damping_ratio``.
    velocity_cutoff: Hz, of the low-pass on the measured velocity; None: VELOCITY_CUTOFF, or of a faster
    loop as much more. coulomb_smoothing: rad/s (m/s), width of tanh in the feedforward's Coulomb friction.
    """

    kind: str = KINDS[0]
    rate: float = 1000.0
    kp: ArrayLike | None = None
    kd: ArrayLike | None = None
    bandwidth: float = 6.0
    damping_ratio: float = 1.0
    velocity_cutoff: float | None = None
    coulomb_smoothing: float = 0.05

    def __post_init__(self) -> None:
        known = (*KINDS, MODEL)
        if self.kind not in known:
            raise InputError("simulation", "controller kind", "a controller", repr(self.kind), known)
        for field in ("rate", "bandwidth", "damping_ratio", "velocity_cutoff", "coulomb_smoothing"):
            value = getattr(self, field)
            if field == "velocity_cutoff" and value is None:
                continue
            if not (np.isfinite(value) and value > 0):
                raise InputError("simulation", f"controller {field}", "a positive number", value)

    @property
    def cutoff(self) -> float:
        """Cutoff of the velocity's low-pass, Hz."""
        if self.velocity_cutoff is not None:
            return self.velocity_cutoff
        return VELOCITY_CUTOFF * max(1.0, self.rate / USUAL_RATE)

    @property
    def logged_kind(self) -> str:
        """The controller's kind in a robot-log."""
        return POSITION_SERVO if self.kind == MODEL else self.kind


def middle_pose(lower: Array, upper: Array) -> Array:
    """The middle of the joints' ranges, (n,); 0 where a joint has no range."""
    limited = np.isfinite(lower) & np.isfinite(upper)
    return np.where(limited, (np.where(limited, lower, 0.0) + np.where(limited, upper, 0.0)) / 2, 0.0)


def diagonal_inertia(chain: Chain, parameters: Array, pose: Array) -> Array:
    """Diagonal (n,) of the mass matrix at a pose (n,), kg·m² (kg)."""
    n = chain.joints
    columns = (PER_JOINT * np.arange(chain.links)[:, None] + np.arange(ARMATURE + 1)).ravel()
    still = np.zeros((n, n))
    inertial = [
        regressor(chain, np.tile(pose, (n, 1)), still, ddq, columns, threads=1) for ddq in (np.eye(n), still)
    ]
    return np.einsum("jjc,c->j", inertial[0] - inertial[1], parameters[columns])


def feedforward(chain: Chain, parameters: Array, reference: Reference, coulomb_smoothing: float) -> Array:
    """Inverse dynamics of a model along a reference, (N, n) N·m; sgn is tanh(dq / coulomb_smoothing)."""
    motion = reference.position, reference.velocity, reference.acceleration
    return inverse_dynamics(chain, parameters, *motion, coulomb_velocity=coulomb_smoothing, threads=1)


@kernel
def pd_command(
    feedforward: float,
    kp: float,
    kd: float,
    position_error: float,
    velocity_error: float,
    torque_limit: float,
) -> float:
    """One joint's command, clipped to ± torque_limit."""
    command = feedforward + kp * position_error + kd * velocity_error
    if command > torque_limit:
        return torque_limit
    if command < -torque_limit:
        return -torque_limit
    return command


def velocity_pole(options: ControllerOptions) -> float:
    """Pole of the low-pass on the measured velocity."""
    return float(np.exp(-2 * np.pi * options.cutoff / options.rate))
