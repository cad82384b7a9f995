"""Forward dynamics and its integration, compiled, for the extended Kalman filter."""

import numpy as np
from numpy.typing import NDArray

from .chain import ChainArrays
from .inverse_dynamics import _inverse_dynamics
from .kinematics import kernel

Array = NDArray[np.float64]
# The chain, the table of standard parameters, Coulomb friction, dead zones.
RobotArrays = tuple[ChainArrays, Array, Array, Array]
# Scratch for positions, velocities, accelerations.
Motions = tuple[Array, Array, Array]


@kernel
def accelerate(
    robot: RobotArrays,
    q: Array,
    dq: Array,
    tau: Array,
    work: Motions,
    torques: Array,
    mass: Array,
    out: Array,
) -> bool:
    """Forward dynamics: ddq (n,) into ``out``, the mass matrix's Cholesky factor into ``mass``."""
    (parent, is_slide, rotation, translation, gravity, springs), table, coulomb, dead_zone = robot
    n = q.size
    positions, velocities, accelerations = work
    for r in range(n + 1):
        for j in range(n):
            positions[r, j], velocities[r, j] = q[j], dq[j]
            accelerations[r, j] = 1.0 if r == j else 0.0
    _inverse_dynamics(
        parent, is_slide, rotation, translation, gravity, springs, table, 0.0,
        positions[: n + 1], velocities[: n + 1], accelerations[: n + 1], torques[: n + 1],
    )  # fmt: skip
    for i in range(n):
        for j in range(n):
            mass[i, j] = torques[j, i] - torques[n, i]
        out[i] = tau[i] - torques[n, i] - coulomb[i] * friction_direction(dq[i], dead_zone[i])
    if not factorise(mass, mass):
        return False
    solve(mass, out)
    return True


@kernel
def factorise(matrix: Array, factor: Array) -> bool:
    """Cholesky factor of a symmetric matrix (n, n) into the lower triangle of ``factor``, which may be it.

    False where the matrix is not positive definite.
    """
    n = matrix.shape[0]
    for j in range(n):
        for i in range(j, n):
            entry = matrix[i, j]
            for c in range(j):
                entry -= factor[i, c] * factor[j, c]
            if i == j:
                if not entry > 0.0:
                    return False
                factor[j, j] = np.sqrt(entry)
            else:
                factor[i, j] = entry / factor[j, j]
    return True


@kernel
def friction_direction(velocity: float, dead_zone: float) -> float:
    """The velocity's sign, linear inside the dead zone."""
    return min(1.0, max(-1.0, velocity / dead_zone))


@kernel
def solve(factor: Array, x: Array) -> None:
    """x <- (L L')^-1 x in place, L the lower triangle of ``factor``."""
    n = x.size
    for i in range(n):
        for c in range(i):
            x[i] -= factor[i, c] * x[c]
        x[i] /= factor[i, i]
    for i in range(n - 1, -1, -1):
        for c in range(i + 1, n):
            x[i] -= factor[c, i] * x[c]
        x[i] /= factor[i, i]


@kernel
def invert(factor: Array, out: Array) -> None:
    """(L L')^-1 into ``out``."""
    out[:] = 0.0
    for j in range(out.shape[0]):
        out[j, j] = 1.0
        solve(factor, out[j])


@kernel
def integrate(
    robot: RobotArrays,
    q: Array,
    dq: Array,
    before: Array,
    after: Array,
    step: float,
    substeps: int,
    work: Motions,
    torques: Array,
    mass: Array,
) -> bool:
    """Move q and dq (n,) on by ``step`` with the midpoint rule, torque linear in between."""
    n = before.size
    h = step / substeps
    position, velocity, tau, acceleration = np.empty(n), np.empty(n), np.empty(n), np.empty(n)
    for s in range(substeps):
        for stage in range(2):
            share = (s + 0.5 * stage) / substeps
            for j in range(n):
                tau[j] = before[j] + share * (after[j] - before[j])
                position[j], velocity[j] = q[j], dq[j]
                if stage == 1:
                    position[j] += 0.5 * h * dq[j]
                    velocity[j] += 0.5 * h * acceleration[j]
            if not accelerate(robot, position, velocity, tau, work, torques, mass, acceleration):
                return False
        for j in range(n):
            q[j] += h * velocity[j]
            dq[j] += h * acceleration[j]
    return True
