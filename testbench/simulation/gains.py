"""Gains of the torque-level tracker: from the inertia over the joints' range, or a servo's own.

At a bandwidth w (rad/s) with damping ratio zeta a joint of inertia I has kp = w² I and kd = 2 zeta w I, where
I is the geometric mean of the largest and the smallest inertia that the joint feels. Where it is lighter the
velocity loop is faster by as much: along each eigenvector of M(q)^-1 diag(kd) it crosses over at the
eigenvalue. What the loop is late by (velocity filter, half a period of difference and half of hold, physics
step) bounds that crossover in the worst pose; a joint beyond it gets a lower bandwidth. A joint that damps
itself by more than kd, D, gets the kp that goes with that: w D / (2 zeta).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from identification.chain import Chain
from identification.errors import InputError
from identification.followers import followed
from identification.inverse_dynamics import inverse_dynamics, mass_matrices
from identification.joint_names import joint_label
from identification.parameters import PER_JOINT, VISCOUS

from .controller import ControllerOptions
from .sensors import per_joint

Array = NDArray[np.float64]

# Poses at which the inertia is taken, beside the middle and zero of the ranges.
POSES = 256
# rad: crossover times lateness, which leaves a phase margin of about 35 degrees in the worst pose.
LATENESS = 1.0
# A joint that turns freely is taken half a turn each way.
FREE = np.pi
# rad (m), of the difference that gravity's stiffness is taken by.
STEP = 1e-4


@dataclass(frozen=True)
class Gains:
    """kp (n,), N·m/rad, kd (n,), N·m·s/rad (N/m, N·s/m), and bandwidth (n,), Hz.

    bandwidth is NaN where the gains do not follow from one. smallest, largest: (n,) kg·m² (kg), the joint's
    inertia with the others free and with the others held, over the range.
    """

    kp: Array
    kd: Array
    bandwidth: Array
    smallest: Array
    largest: Array

    def reduced(self, asked: float, joint_names: Sequence[str]) -> tuple[str, ...]:
        """A line for each joint whose bandwidth had to be lower than the one asked for, Hz."""
        return tuple(
            f"{joint_names[joint]}: bandwidth {self.bandwidth[joint]:.2g} Hz instead of {asked:g} Hz, since "
            f"its inertia falls from {self.largest[joint]:.2g} to {self.smallest[joint]:.2g} over the range"
            for joint in np.flatnonzero(self.bandwidth < asked * (1 - 1e-9)).tolist()
        )


def gains(
    options: ControllerOptions,
    chain: Chain,
    parameters: Array,
    lower: Array,
    upper: Array,
    timestep: float = 0.0,
) -> Gains:
    """The tracker's gains: those given, else by bandwidth and damping ratio from the inertia over the range.

    parameters: (14 links,). lower, upper: (n,), infinite where a joint turns freely. timestep: s, of the
    physics. Raises InputError for gains that do not fit the joints, and for a joint that moves no inertia.
    """
    n = chain.joints
    inertia = inertia_over_range(chain, parameters, lower, upper)
    largest = np.einsum("kjj->kj", inertia).max(axis=0)
    smallest = 1 / np.einsum("kjj->kj", np.linalg.inv(inertia)).max(axis=0)
    ratio, asked = options.damping_ratio, 2 * np.pi * options.bandwidth
    late = 1 / (2 * np.pi * options.cutoff) + 1 / options.rate + timestep
    typical = np.sqrt(smallest * largest)
    kd = within_crossover(2 * ratio * asked * typical, inertia, LATENESS / late)
    damping = np.maximum(kd, parameters.reshape(-1, PER_JOINT)[:n, VISCOUS])
    w = np.minimum(damping / (2 * ratio * typical), asked)
    found = Gains(w * damping / (2 * ratio), kd, w / (2 * np.pi), smallest, largest)
    unknown = np.full(n, np.nan)
    if options.kp is not None:
        found = replace(found, kp=per_joint(options.kp, n, "kp", 0), bandwidth=unknown)
    if options.kd is not None:
        found = replace(found, kd=per_joint(options.kd, n, "kd", 0), bandwidth=unknown)
    return found


def within_crossover(kd: Array, inertia: Array, crossover: float) -> Array:
    """kd (n,), lowered joint by joint until no eigenvalue of M^-1 diag(kd) exceeds ``crossover``, rad/s.

    inertia: (P, n, n) mass matrices M. The eigenvalues are those of diag(kd)^1/2 M^-1 diag(kd)^1/2; each
    joint is lowered by its share of the fastest eigenvector, so that one without a part in it keeps its gain.
    """
    kd, inverse = kd.copy(), np.linalg.inv(inertia)
    while True:
        root = np.sqrt(kd)
        values = np.linalg.eigvalsh(root[:, None] * inverse * root)[:, -1]
        pose = int(np.argmax(values))
        if values[pose] <= crossover:
            return kd
        # That pose is settled before all are looked at again.
        while True:
            root = np.sqrt(kd)
            values, vectors = np.linalg.eigh(root[:, None] * inverse[pose] * root)
            if values[-1] <= crossover:
                break
            share = vectors[:, -1] ** 2
            # A step a little beyond the bound ends the search after finitely many.
            kd *= (0.999 * crossover / values[-1]) ** (share / share.max())


def inertia_over_range(chain: Chain, parameters: Array, lower: Array, upper: Array) -> Array:
    """Mass matrices (P, n, n) at poses spread evenly over the joints' ranges, the middle and zero among them.

    Raises InputError for a joint that moves no inertia in some pose.
    """
    poses = poses_over_range(lower, upper)
    inertia = mass_matrices(chain, parameters, poses, threads=1)
    if not np.linalg.eigvalsh(inertia)[:, 0].min() > 0:
        joint = chain.joint_names[int(np.argmin(np.einsum("kjj->kj", inertia).min(axis=0)))]
        expected = "links or rotors (armature) with inertia about every joint, in every pose"
        raise InputError("model", joint, expected, "none: a loop around it cannot be stable")
    return inertia


def poses_over_range(lower: Array, upper: Array) -> Array:
    """Poses (P, n) spread evenly over the joints' ranges, the middle and zero among them."""
    bounded = np.isfinite(lower) & np.isfinite(upper)
    low, high = np.where(bounded, lower, -FREE), np.where(bounded, upper, FREE)
    spread = low + (high - low) * qmc.Halton(len(low), scramble=False).random(POSES)
    return np.vstack([spread, (low + high) / 2, np.clip(0.0, low, high)])


def sag(kp: Array, chain: Chain, parameters: Array, lower: Array, upper: Array) -> tuple[float, int]:
    """The largest share over the range that gravity's stiffness, and springs', has of the loop's; its joint.

    It is the largest eigenvalue, by its size, of diag(kp)^-1/2 H diag(kp)^-1/2 with H = dg/dq. From 1 on the
    loop does not hold the robot up; an error of the feedforward moves it by 1 / (1 - share) times as much as
    without gravity. kp: (n,), above 0.
    """
    poses = poses_over_range(lower, upper)
    still = np.zeros_like(poses)

    def gravity(where: Array) -> Array:
        return inverse_dynamics(chain, parameters, where, still, still, threads=1)

    units = STEP * np.eye(len(kp))
    columns = [(gravity(poses + unit) - gravity(poses - unit)) / (2 * STEP) for unit in units]
    stiffness = np.stack(columns, axis=2)
    root = np.sqrt(kp)
    values, vectors = np.linalg.eigh((stiffness + stiffness.swapaxes(1, 2)) / 2 / root[:, None] / root)
    largest = np.abs(values)
    pose, which = np.unravel_index(int(np.argmax(largest)), largest.shape)
    return float(largest[pose, which]), int(np.argmax(vectors[pose, :, which] ** 2))


def servo_gains(model: Any) -> Gains:
    """Gains of a model's position actuators, one a joint: force = kp (target - q) - kv dq.

    model: compiled ``mujoco.MjModel``. Raises InputError for a joint without one.
    """
    n = model.njnt
    kp, kd = np.zeros(n), np.zeros(n)
    affine, fixed = mujoco.mjtBias.mjBIAS_AFFINE, mujoco.mjtGain.mjGAIN_FIXED
    for actuator in range(model.nactuator):
        gain, bias = model.actuator_gainprm[actuator], model.actuator_biasprm[actuator]
        on_joint = model.actuator_trntype[actuator] == mujoco.mjtTrn.mjTRN_JOINT
        position = gain[0] > 0 and np.isclose(bias[1], -gain[0])
        kinds = model.actuator_biastype[actuator] == affine and model.actuator_gaintype[actuator] == fixed
        if on_joint and position and kinds:
            gear = model.actuator_gear[actuator, 0]
            joint = int(model.actuator_trnid[actuator, 0])
            kp[joint] += gear**2 * gain[0]
            kd[joint] -= gear**2 * bias[2]
    found = followed(model)
    own = [joint for joint in range(n) if joint not in found]
    for joint in [joint for joint in own if kp[joint] <= 0]:
        expected = "a position actuator on every joint; else choose pd_with_model_feedforward or pd"
        raise InputError("simulation", "controller model", expected, f"none on {joint_label(model, joint)}")
    unknown = np.full(len(own), np.nan)
    return Gains(kp[own], kd[own], unknown, unknown, unknown)
