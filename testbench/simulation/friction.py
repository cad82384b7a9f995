"""Exact Coulomb friction with stiction in one physics step.

The friction lambda of a step of length h solves the box-constrained linear complementarity problem
(Moreau's time stepping; Stewart & Trinkle 1996; Acary & Brogliato, "Numerical Methods for Nonsmooth
Dynamical Systems", 2008, ch. 10)

    v+ = v + h M^-1 (f - lambda),   lambda_i = fc_i sgn(v+_i)  or  (v+_i = 0 and |lambda_i| <= fc_i),

whose solution is unique because M^-1 is positive definite. f is every other force at the joints.
"""

import numpy as np
from numpy.typing import NDArray

from identification.kinematics import kernel

from .led import solve_at_joints

Array = NDArray[np.float64]

# Reversals and rest take tens of sweeps; a strongly coupled arm at rest some hundred.
SWEEPS = 500
TOLERANCE = 1e-13


@kernel
def coulomb_friction(
    model: int,
    data: int,
    timestep: float,
    velocity: Array,
    force: Array,
    coulomb: Array,
    friction: Array,
    work: Array,
    led: int = 0,
) -> None:
    """Write the friction torque lambda (n,) of this step into ``friction``.

    model, data: addresses; data holds the factor of M. velocity, force, coulomb: (n,).
    work: (2 n + 2, n) scratch. led: address as of ``solve_at_joints``.
    """
    n = velocity.size
    load, acceleration = work[0], work[1]
    for j in range(n):
        friction[j] = coulomb[j] * np.sign(velocity[j])
        load[j] = force[j] - friction[j]
    solve_at_joints(led, model, data, acceleration.ctypes.data, load.ctypes.data, 1)
    sliding = True
    for j in range(n):
        after = velocity[j] + timestep * acceleration[j]
        # True exactly when sgn(v+) is the sign the friction was taken with.
        sliding = sliding and (coulomb[j] == 0.0 or velocity[j] * after > 0.0)
    if not sliding:
        _gauss_seidel(model, data, timestep, velocity, acceleration, coulomb, friction, work[2:], led)


@kernel
def _gauss_seidel(
    model: int,
    data: int,
    timestep: float,
    velocity: Array,
    acceleration: Array,
    coulomb: Array,
    friction: Array,
    work: Array,
    led: int,
) -> None:
    """Projected Gauss-Seidel from the sliding guess in ``friction``, whose acceleration is given."""
    n = velocity.size
    unit, inverse = work[:n], work[n:]
    unit[:] = 0.0
    largest = 0.0
    for j in range(n):
        unit[j, j] = 1.0
        if coulomb[j] > largest:
            largest = coulomb[j]
    solve_at_joints(led, model, data, inverse.ctypes.data, unit.ctypes.data, n)
    for _ in range(SWEEPS):
        change = 0.0
        for j in range(n):
            after = velocity[j] + timestep * acceleration[j]
            # The friction that stops the joint, if the joint has that much.
            stopping = friction[j] + after / (timestep * inverse[j, j])
            if stopping > coulomb[j]:
                stopping = coulomb[j]
            elif stopping < -coulomb[j]:
                stopping = -coulomb[j]
            step = stopping - friction[j]
            friction[j] = stopping
            for i in range(n):
                acceleration[i] -= inverse[i, j] * step
            if abs(step) > change:
                change = abs(step)
        if change <= TOLERANCE * largest:
            break
