"""The extended Kalman filter of a robot arm with its base parameters as constant states.

Gautier & Poignet (2001), "Extended Kalman filtering and weighted least squares dynamic identification
of robot", Control Engineering Practice 9(12): the state [q, dq, beta] is driven by the measured torque,

    d/dt dq = M(q, beta)^-1 (tau - h(q, dq, beta)),   d/dt beta = 0,

and the position is measured. The noise of the torque is that of the prediction. Coulomb friction is
linear inside the dead zone, where the sign of the velocity is unknown and a joint's torque says little.
"""

import numpy as np
from numpy.typing import NDArray

from .chain import ChainArrays
from .forward_dynamics import Motions, RobotArrays, accelerate, friction_direction, integrate, invert
from .inverse_dynamics import _inverse_dynamics
from .kinematics import copy_row, copy_rows, kernel
from .parameters import COULOMB, PER_JOINT
from .regressor import _regressor

Array = NDArray[np.float64]


# Step of the differences in position and velocity, rad and rad/s (m).
DIFFERENCE = 1e-6
# Smallest pivot of the mass matrix's Cholesky factor, as a share of that at the start.
SMALLEST_PIVOT = 0.3


@kernel
def extended_kalman_filter(
    chain: ChainArrays,
    columns: NDArray[np.int64],
    slots: NDArray[np.int64],
    position: Array,
    torque: Array,
    acceleration: Array,
    timing: tuple[int, float, int],
    dead_zone: Array,
    noise: tuple[Array, Array],
    scale: Array,
    constant: Array,
    state: Array,
    covariance: Array,
) -> bool:
    """Run over K samples; ``state`` and ``covariance`` become those after the last. True if all went well.

    chain: its arrays. columns, slots: of the base regressor.
    position: (K, n). torque: (k (K - 1) + 1, n), k to each step between positions.
    acceleration: (K - 1, n) of the measured motion, in the middle of each step. The derivatives are taken
    there: along an acceleration that the noisy torque makes they would be correlated with its noise, and
    the estimate biased. timing: k, the seconds
    between torques, and the steps of integration from one to the next. dead_zone: (n,) rad/s. noise:
    variance of the position (n,) and of the torque over each step (K - 1, n). scale: (b,) the parameters'
    units in the state. constant: (14 n,) to which they are added at ``columns``. state: (2 n + b,).
    covariance: its, in those units. False where the mass matrix is not positive.
    """
    position_variance, torque_variance = noise
    stride, sample_time, substeps = timing
    step = stride * sample_time
    n, b = position.shape[1], columns.size
    size = 2 * n + b
    table, coulomb = np.empty((n, PER_JOINT)), np.empty(n)
    gain, column = np.empty(size), np.empty(size)
    slopes = np.empty((2 * n, size))
    inverse, unused = np.empty((n, n)), np.empty(n)
    work = (np.empty((2 * n + 1, n)), np.empty((2 * n + 1, n)), np.empty((2 * n + 1, n)))
    torques, mass = np.empty((2 * n + 1, n)), np.empty((n, n))
    rows, pivots = np.empty((1, n, b)), np.empty(n)
    before, covariance_before = np.empty(size), np.empty((size, size))
    for k in range(position.shape[0]):
        if k > 0:
            _parameters(constant, columns, scale, state[2 * n :], table, coulomb)
            robot = (chain, table, coulomb, dead_zone)
            first = stride * (k - 1)
            q, dq = state[:n], state[n : 2 * n]
            if not accelerate(robot, q, dq, torque[first], work, torques, mass, unused):
                return False
            invert(mass, inverse)
            _slopes(
                robot, columns, slots, scale, state, acceleration[k - 1], inverse, work, torques, rows, slopes
            )
            _propagate(covariance, slopes, inverse, torque_variance[k - 1], step)
            for sample in range(first, first + stride):
                if not integrate(
                    robot,
                    q,
                    dq,
                    torque[sample],
                    torque[sample + 1],
                    sample_time,
                    substeps,
                    work,
                    torques,
                    mass,
                ):
                    return False
        copy_row(state, before)
        copy_rows(covariance, covariance_before)
        for j in range(n):
            _correct(state, covariance, j, position[k, j], position_variance[j], size, gain, column)
        _parameters(constant, columns, scale, state[2 * n :], table, coulomb)
        q, dq = state[:n], state[n : 2 * n]
        robot = (chain, table, coulomb, dead_zone)
        positive = accelerate(robot, q, dq, torque[stride * k], work, torques, mass, unused)
        if k == 0:
            if not positive:
                return False
            for j in range(n):
                pivots[j] = SMALLEST_PIVOT * mass[j, j]
        for j in range(n):
            positive = positive and mass[j, j] > pivots[j]
        if not positive:
            # A correction that no arm could have: the parameters sit it out, which Joseph's form allows.
            copy_row(before, state)
            copy_rows(covariance_before, covariance)
            for j in range(n):
                _correct(state, covariance, j, position[k, j], position_variance[j], 2 * n, gain, column)
    return True


@kernel
def _parameters(
    constant: Array, columns: NDArray[np.int64], scale: Array, scaled: Array, table: Array, coulomb: Array
) -> None:
    """Standard parameters of the state: without Coulomb friction in ``table`` (n, 14), which goes apart."""
    flat = table.reshape(-1)
    copy_row(constant, flat)
    for i in range(columns.size):
        flat[columns[i]] += scale[i] * scaled[i]
    for j in range(coulomb.size):
        coulomb[j] = table[j, COULOMB]
        table[j, COULOMB] = 0.0


@kernel
def _slopes(
    robot: RobotArrays,
    columns: NDArray[np.int64],
    slots: NDArray[np.int64],
    scale: Array,
    state: Array,
    acceleration: Array,
    inverse: Array,
    work: Motions,
    torques: Array,
    rows: Array,
    slopes: Array,
) -> None:
    """The derivative of (dq, ddq) with respect to the state into ``slopes`` (2 n, 2 n + b).

    The slope of friction inside the dead zone is left out: too steep for a step, and not to be relied on.
    """
    (parent, is_slide, rotation, translation, gravity, springs), table, _, dead_zone = robot
    n, b = acceleration.size, columns.size
    positions, velocities, accelerations = work
    for r in range(2 * n + 1):
        for j in range(n):
            positions[r, j], velocities[r, j], accelerations[r, j] = state[j], state[n + j], acceleration[j]
    for j in range(n):
        positions[j, j] += DIFFERENCE
        velocities[n + j, j] += DIFFERENCE
    _inverse_dynamics(
        parent, is_slide, rotation, translation, gravity, springs, table, 0.0,
        positions, velocities, accelerations, torques,
    )  # fmt: skip
    _regressor(
        parent, is_slide, rotation, translation, gravity, slots, 0.0,
        positions[2 * n :], velocities[2 * n :], accelerations[2 * n :], rows,
    )  # fmt: skip
    for i in range(b):
        if columns[i] % PER_JOINT == COULOMB:
            joint = columns[i] // PER_JOINT
            rows[0, joint, i] = friction_direction(state[n + joint], dead_zone[joint])
    slopes[:] = 0.0
    for i in range(n):
        slopes[i, n + i] = 1.0
    for r in range(2 * n):
        for j in range(n):
            change = (torques[r, j] - torques[2 * n, j]) / DIFFERENCE
            for i in range(n):
                slopes[n + i, r] -= inverse[i, j] * change
    for c in range(b):
        for j in range(n):
            change = rows[0, j, c] * scale[c]
            if change != 0.0:
                for i in range(n):
                    slopes[n + i, 2 * n + c] -= inverse[i, j] * change


@kernel
def _propagate(covariance: Array, slopes: Array, inverse: Array, variance: Array, step: float) -> None:
    """P <- F P F' + G S G' with F = 1 + A h + (A h)² / 2, in place; S the variance of the torques held."""
    n, size = variance.size, covariance.shape[0]
    half = 0.5 * step
    # F - 1 of the moving states; the parameters stay.
    change = np.empty((2 * n, size))
    for r in range(2 * n):
        for c in range(size):
            entry = slopes[r, c]
            for i in range(2 * n):
                entry += half * slopes[r, i] * slopes[i, c]
            change[r, c] = step * entry
    moved = np.zeros((2 * n, size))
    for r in range(2 * n):
        for i in range(size):
            factor = change[r, i]
            if factor != 0.0:
                for c in range(size):
                    moved[r, c] += factor * covariance[i, c]
    for r in range(2 * n):
        for c in range(r, 2 * n):
            entry = moved[r, c] + moved[c, r]
            for i in range(size):
                entry += moved[r, i] * change[c, i]
            covariance[r, c] += entry
        for c in range(2 * n, size):
            covariance[r, c] += moved[r, c]
    for i in range(n):
        for j in range(i, n):
            spread = 0.0
            for c in range(n):
                spread += inverse[i, c] * variance[c] * inverse[j, c]
            spread *= step * step
            covariance[i, j] += 0.25 * step * step * spread
            covariance[i, n + j] += half * spread
            if i != j:
                covariance[j, n + i] += half * spread
            covariance[n + i, n + j] += spread
    for r in range(size):
        for c in range(r):
            covariance[r, c] = covariance[c, r]


@kernel
def _correct(
    state: Array,
    covariance: Array,
    index: int,
    measured: float,
    variance: float,
    moved: int,
    gain: Array,
    row: Array,
) -> None:
    """Take in one measured state, covariance in Joseph's form (1 - k e') P (1 - k e')' + k r k'.

    moved: the first so many states are corrected, the gain of the others is zero.
    """
    size = state.size
    spread = covariance[index, index] + variance
    error = measured - state[index]
    for i in range(size):
        gain[i] = covariance[i, index] / spread if i < moved else 0.0
        row[i] = covariance[index, i]
        state[i] += gain[i] * error
    for i in range(size):
        for j in range(i, size):
            entry = covariance[i, j] - gain[i] * row[j] - row[i] * gain[j] + gain[i] * gain[j] * spread
            covariance[i, j] = entry
            covariance[j, i] = entry
