"""One step of simulated position servos: velocities after it, with the friction and contact that act in it.

Coulomb friction is the impulse that opposes the velocity after the step (Moreau's time stepping; Acary &
Brogliato, "Numerical Methods for Nonsmooth Dynamical Systems", 2008, ch. 10): a joint slides against it or
sticks.
"""

import numpy as np
from numpy.typing import NDArray

from ..forward_dynamics import factorise, solve
from ..kinematics import kernel
from .plant import GAP

Array = NDArray[np.float64]

# rad/s (m/s) by which velocities may miss the friction law, and sweeps to get there.
VELOCITY_TOLERANCE, SWEEPS = 1e-13, 100
# rad/s and sweeps, likewise with play: its impulses converge more slowly.
PLAY_TOLERANCE, PLAY_SWEEPS = 1e-9, 200
# Of a joint's inertia, what its rotor has at least where there is play.
LEAST_ROTOR = 0.02


@kernel
def plain_step(
    mass: Array,
    factor: Array,
    offset: Array,
    damping: Array,
    table: Array,
    bias: Array,
    level: Array,
    h: float,
    v: Array,
    new: Array,
    rhs: Array,
    share: Array,
) -> bool:
    """The velocity after a step into ``new``; the share of the highest friction that acts into ``share``.

    (M + h/2 D) new = M v + h (u - bias) - h/2 D v - h share level, |share| <= 1, against the velocity.
    False where M is not positive definite.
    """
    n = v.size
    for i in range(n):
        own = damping[i] + table[i, 11]
        rhs[i] = h * (offset[i] - bias[i]) - 0.5 * h * own * v[i]
        for j in range(n):
            rhs[i] += mass[i, j] * v[j]
    for i in range(n):
        mass[i, i] += 0.5 * h * (damping[i] + table[i, 11])
    if not factorise(mass, factor):
        return False
    # With the friction of the step before: exact where nothing stops or starts.
    for i in range(n):
        new[i] = rhs[i] - share[i] * h * level[i]
    solve(factor, new)
    # Coordinate descent on 1/2 new' M new - rhs' new + sum h level |new|, which is convex.
    for _ in range(SWEEPS):
        moved = 0.0
        for i in range(n):
            force = rhs[i]
            for j in range(n):
                if j != i:
                    force -= mass[i, j] * new[j]
            most = h * level[i]
            impulse = min(most, max(-most, force))
            share[i] = impulse / most if most > 0.0 else 0.0
            value = (force - impulse) / mass[i, i]
            moved = max(moved, abs(value - new[i]))
            new[i] = value
        if moved < VELOCITY_TOLERANCE:
            break
    return True


@kernel
def step_with_play(
    link_mass: Array,
    factor: Array,
    offset: Array,
    damping: Array,
    table: Array,
    bias: Array,
    level: Array,
    h: float,
    v: Array,
    new: Array,
    rhs: Array,
    share: Array,
    drive: NDArray[np.int64],
    play: Array,
) -> bool:
    """The step where motors have coordinates of their own and touch their links at the ends of a play.

    drive: (n,) coordinate of each motor; that of its link where there is no play.
    (M + h/2 D) new = M v + h (u - bias) - h/2 D v + J' p: impulses p of friction, at most h level, against
    the motors' velocities, and of contact, which keep each play within half its gap. Solved for p by
    projected Gauss-Seidel. False where M is not positive definite.
    """
    n, size = drive.size, v.size
    mass = np.zeros((size, size))
    for i in range(n):
        for j in range(n):
            mass[i, j] = link_mass[i, j]
    for j in range(n):
        if drive[j] >= n:
            rotor = max(table[j, 10], LEAST_ROTOR * link_mass[j, j])
            mass[j, j] -= min(table[j, 10], (1 - LEAST_ROTOR) * link_mass[j, j])
            mass[drive[j], drive[j]] = rotor
    for i in range(size):
        rhs[i] = 0.0
        for j in range(size):
            rhs[i] += mass[i, j] * v[j]
    for j in range(n):
        d = drive[j]
        own = damping[j] + table[j, 11]
        rhs[j] -= h * bias[j]
        rhs[d] += h * offset[j] - 0.5 * h * own * v[d]
        mass[d, d] += 0.5 * h * own
    if not factorise(mass, factor):
        return False
    solve(factor, rhs)
    # Rows of J: the motors' velocities, then motor less link where there is play.
    response = np.zeros((size, size))
    column = np.empty(size)
    for c in range(size):
        column[:] = 0.0
        for j in range(n):
            if c == j:
                column[drive[j]] = 1.0
            if c >= n and c == drive[j]:
                column[c], column[j] = 1.0, -1.0
        solve(factor, column)
        response[c] = column
    impulse = np.zeros(size)
    for j in range(n):
        impulse[j] = -share[j] * h * level[j]
    new[:] = rhs
    for c in range(size):
        for i in range(size):
            new[i] += response[c, i] * impulse[c]
    for _ in range(PLAY_SWEEPS):
        moved = 0.0
        for j in range(n):
            d = drive[j]
            for contact in range(2 if d >= n else 1):
                c = d if contact == 1 else j
                if contact == 1:
                    own = response[c, d] - response[c, j]
                    # Without this impulse the play would open or close at this speed.
                    speed = new[d] - new[j] - own * impulse[c]
                    half = 0.5 * table[j, GAP]
                    wanted = min((half - play[j]) / h, max((-half - play[j]) / h, speed))
                    value = (wanted - speed) / own
                else:
                    own = response[c, d]
                    speed = new[d] - own * impulse[c]
                    most = h * level[j]
                    value = min(most, max(-most, -speed / own))
                change = value - impulse[c]
                if change != 0.0:
                    impulse[c] = value
                    for i in range(size):
                        new[i] += response[c, i] * change
                    moved = max(moved, abs(change * own))
        if moved < PLAY_TOLERANCE:
            break
    for j in range(n):
        most = h * level[j]
        share[j] = -impulse[j] / most if most > 0.0 else 0.0
    return True
