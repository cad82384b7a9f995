"""Joints that follow others in a physics step: MuJoCo's full tree, moved as the joints that lead it.

With rows J that say q_f - ratio q_l = offset, a force y on the tree brings about

    a = M^-1 (y - J' lambda),   J M^-1 J' lambda = J M^-1 y,

which is G (G' M G)^-1 G' y (Udwadia & Kalaba, "Analytical Dynamics", 1996, ch. 3). MuJoCo steps the tree with
J' lambda taken off the applied force, so followers neither lag nor give way.
"""

from typing import Any

import numpy as np
from numba import carray
from numpy.typing import NDArray

from identification.followers import Followers
from identification.forward_dynamics import factorise, solve
from identification.kinematics import kernel

from ..native import float_pointer
from .mujoco_pointers import solve_mass_matrix

Array = NDArray[np.float64]

# Rows of the table of links: the joint that moves each, ratio, offset; force and acceleration; M^-1 J'.
LEADER, RATIO, OFFSET, FORCE, MOTION, PULLED = range(6)
# Rows of what a step sees and sets of the joints.
POSITION, VELOCITY, BIAS, PASSIVE, APPLIED = range(5)
JOINT_ROWS, HEAD = 5, 2


def led_memory(full: Followers | None) -> Array:
    """The arrays that the kernels here work on, flat; empty where no joint follows another.

    n and m, the joints' own links and the followers', the table of links, lambda, the factor of J M^-1 J',
    the rows of the joints.
    """
    if full is None:
        return np.empty(0)
    n, m = len(full.own), len(full.place)
    table = np.zeros((PULLED + m - n, m))
    table[LEADER], table[RATIO], table[OFFSET] = full.leader, full.ratio, full.offset
    scratch = np.zeros((m - n) * (m - n + 1) + JOINT_ROWS * n)
    return np.concatenate([[n, m], full.own, full.following, table.ravel(), scratch])


@kernel
def _views(led: int) -> Any:
    """The parts of ``led_memory`` after the counts."""
    counts = carray(float_pointer(led), HEAD)
    n, m = int(counts[0]), int(counts[1])
    f = m - n
    table, multipliers = HEAD + m, HEAD + m + (PULLED + f) * m
    factor, joints = multipliers + f, multipliers + f + f * f
    flat = carray(float_pointer(led), joints + JOINT_ROWS * n)
    return (
        flat[HEAD : HEAD + n],
        flat[HEAD + n : table],
        flat[table:multipliers].reshape((PULLED + f, m)),
        flat[multipliers:factor],
        flat[factor:joints].reshape((f, f)),
        flat[joints:].reshape((JOINT_ROWS, n)),
    )


@kernel
def solve_at_joints(led: int, model: int, data: int, x: int, y: int, count: int) -> None:
    """x = (G' M G)^-1 y for ``count`` vectors (n,), by addresses; led is 0 where no joint follows another."""
    if led == 0:
        solve_mass_matrix(model, data, x, y, np.int32(count))
        return
    own, _, table, _, _, _ = _views(led)
    forces = carray(float_pointer(y), (count, own.size))
    found = carray(float_pointer(x), (count, own.size))
    for k in range(count):
        for i in range(table.shape[1]):
            table[FORCE, i] = 0.0
        for j in range(own.size):
            table[FORCE, int(own[j])] = forces[k, j]
        _constrain(led, model, data)
        for j in range(own.size):
            found[k, j] = table[MOTION, int(own[j])]


@kernel
def begin_step(
    led: int, model: int, data: int, position: Array, velocity: Array, bias: Array, passive: Array
) -> Array:
    """Rows (JOINT_ROWS, n) of the joints, read from MuJoCo's arrays (m,); what a solution needs is made."""
    own, following, table, _, factor, joints = _views(led)
    for j in range(own.size):
        i = int(own[j])
        joints[POSITION, j], joints[VELOCITY, j] = position[i], velocity[i]
        joints[BIAS, j], joints[PASSIVE, j] = bias[i], passive[i]
    for k in range(following.size):
        i = int(following[k])
        j, ratio = int(table[LEADER, i]), table[RATIO, i]
        joints[BIAS, j] += ratio * bias[i]
        joints[PASSIVE, j] += ratio * passive[i]
        for other in range(table.shape[1]):
            table[FORCE, other] = 0.0
        table[FORCE, i], table[FORCE, int(own[j])] = 1.0, -ratio
        pulled = table[PULLED + k]
        solve_mass_matrix(model, data, pulled.ctypes.data, table[FORCE].ctypes.data, np.int32(1))
    for k in range(following.size):
        for other in range(following.size):
            factor[k, other] = _apart(own, following, table, k, table[PULLED + other])
    factorise(factor, factor)
    return joints


@kernel
def end_step(
    led: int,
    model: int,
    data: int,
    position: Array,
    velocity: Array,
    bias: Array,
    passive: Array,
    applied: Array,
) -> None:
    """Set MuJoCo's arrays (m,) so that its step moves the tree as the joints, under their applied force."""
    own, _, table, _, _, joints = _views(led)
    for i in range(table.shape[1]):
        j = int(table[LEADER, i])
        position[i] = table[RATIO, i] * joints[POSITION, j] + table[OFFSET, i]
        velocity[i] = table[RATIO, i] * joints[VELOCITY, j]
        table[FORCE, i] = passive[i] - bias[i]
    for j in range(own.size):
        table[FORCE, int(own[j])] += joints[APPLIED, j]
    _constrain(led, model, data)
    for i in range(table.shape[1]):
        applied[i] = table[FORCE, i] - passive[i] + bias[i]


@kernel
def _constrain(led: int, model: int, data: int) -> None:
    """Take J' lambda off the table's force, and write the acceleration that is left."""
    own, following, table, multipliers, factor, _ = _views(led)
    solve_mass_matrix(model, data, table[MOTION].ctypes.data, table[FORCE].ctypes.data, np.int32(1))
    for k in range(following.size):
        multipliers[k] = _apart(own, following, table, k, table[MOTION])
    solve(factor, multipliers)
    for k in range(following.size):
        i = int(following[k])
        for other in range(table.shape[1]):
            table[MOTION, other] -= multipliers[k] * table[PULLED + k, other]
        table[FORCE, i] -= multipliers[k]
        table[FORCE, int(own[int(table[LEADER, i])])] += table[RATIO, i] * multipliers[k]


@kernel
def _apart(own: Array, following: Array, table: Array, k: int, motion: Array) -> float:
    """How far a follower's motion is from its leader's times the ratio; motion: (m,)."""
    i = int(following[k])
    return motion[i] - table[RATIO, i] * motion[int(own[int(table[LEADER, i])])]
