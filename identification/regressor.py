"""Batched inverse-dynamics regressor: tau = Y(q, dq, ddq) theta, linear in the standard parameters.

The row of joint i in the block of link j is the power of link j's wrench along joint i's unit
motion, taken in link j's frame (Atkeson, An & Hollerbach 1986; Khalil & Dombre 2004, ch. 9). With
omega, alpha, a the link's angular velocity, angular acceleration and origin acceleration less
gravity, and (w, u) the unit motion of joint i at link j's origin (angular, linear):

    inertia entries  w' E alpha + (w x omega)' E omega      for each of the six unit inertias E
    first moments    u x alpha + (u x omega) x omega + a x w
    mass             u . a

Only the 6-vectors (w, u) travel out along the branches, never 6 x 10 matrices.
"""

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numpy.typing import NDArray

from .chain import Chain
from .followers import Followers
from .kinematics import (
    branching,
    copy_rows,
    cross,
    into_link,
    kernel,
    link_rotation,
    origin_acceleration,
    paths_to,
)
from .parameters import PER_JOINT

Array = NDArray[np.float64]

# Samples that take a thread much longer than it takes to start.
BLOCK = 4096


def regressor(
    chain: Chain,
    q: Array,
    dq: Array,
    ddq: Array,
    columns: NDArray[np.int64] | None = None,
    coulomb_velocity: float = 0.0,
    threads: int | None = None,
    out: Array | None = None,
) -> Array:
    """Regressor rows for N samples, shape (N, n, c), so that tau = out @ theta[columns].

    q, dq, ddq: (N, n) in rad, rad/s, rad/s² (m for slide joints).
    columns: (c,) indices into the standard vector (all 14 a link when None); only these are written.
    coulomb_velocity: rad/s; 0 gives sgn(dq) for Coulomb columns, else tanh(dq / coulomb_velocity).
    threads: workers (all cores when None); the result does not depend on it.
    out: written to when given, shape (N, n, c), C order.
    """
    if chain.followers is not None:
        found = _of_all_links(chain, chain.followers, q, dq, ddq, columns, coulomb_velocity, threads)
        if out is None:
            return found
        out[:] = found
        return out
    q, dq, ddq = (np.ascontiguousarray(x, dtype=np.float64) for x in (q, dq, ddq))
    slots, count = column_slots(chain.joints, columns)
    if out is None:
        out = np.empty((len(q), chain.joints, count))
    arguments = (*chain.arrays[:-1], slots, coulomb_velocity)

    def fill(start: int, stop: int) -> None:
        part = slice(start, stop)
        _regressor(*arguments, q[part], dq[part], ddq[part], out[part])

    in_blocks(fill, len(q), threads, BLOCK)
    return out


def _of_all_links(
    chain: Chain,
    followers: Followers,
    q: Array,
    dq: Array,
    ddq: Array,
    columns: NDArray[np.int64] | None,
    coulomb_velocity: float,
    threads: int | None,
) -> Array:
    """The regressor of the full tree, the rows of followers added to those of their leaders."""
    wanted = np.arange(PER_JOINT * chain.links) if columns is None else columns
    motion = followers.positions(q), followers.motions(dq), followers.motions(ddq)
    rows = regressor(chain.tree, *motion, followers.columns_in_tree(wanted), coulomb_velocity, threads)
    folded = followers.folded(rows)
    folded[:, :, followers.is_nobodys(wanted)] = 0.0
    return folded


def column_slots(joints: int, columns: NDArray[np.int64] | None) -> tuple[NDArray[np.int64], int]:
    """Where each standard column is written, (14 n,), and how many are, c; slot c is a dustbin."""
    total = PER_JOINT * joints
    if columns is None:
        return np.arange(total), total
    slots = np.full(total, len(columns), dtype=np.int64)
    slots[columns] = np.arange(len(columns))
    return slots, len(columns)


def in_blocks(work: Callable[[int, int], None], samples: int, threads: int | None, least: int) -> None:
    """Call work(start, stop) over parts of the samples, at least so many each, on that many threads.

    threads: all cores when None.
    """
    workers = min(threads or os.cpu_count() or 1, samples // least)
    if workers <= 1:
        work(0, samples)
        return
    edges = np.linspace(0, samples, workers + 1).astype(int)
    with ThreadPoolExecutor(workers) as pool:
        list(pool.map(work, edges[:-1], edges[1:]))


@kernel
def _regressor(
    parent: NDArray[np.int64],
    is_slide: NDArray[np.bool_],
    rotation: Array,
    translation: Array,
    gravity: Array,
    slots: NDArray[np.int64],
    coulomb_velocity: float,
    q: Array,
    dq: Array,
    ddq: Array,
    out: Array,
) -> None:
    n, c = is_slide.size, out.shape[2]
    r, is_left = np.empty(9), branching(parent)
    paths, depths = paths_to(parent)
    # Row j + 1 is link j, row 0 the base.
    links = np.zeros((n + 1, 9))
    links[0, 6], links[0, 7], links[0, 8] = -gravity[0], -gravity[1], -gravity[2]
    motions, motions_of = np.zeros((n, 6)), np.zeros((n, n, 6))
    # One sample's rows stay in the first-level cache; unwanted columns fall into the last slot.
    rows = np.zeros((n, c + 1))
    for t in range(q.shape[0]):
        ox = oy = oz = lx = ly = lz = 0.0
        ax, ay, az = -gravity[0], -gravity[1], -gravity[2]
        for j in range(n):
            before = parent[j]
            if before != j - 1:
                # A branch: on from where it leaves.
                ox, oy, oz = links[before + 1, 0], links[before + 1, 1], links[before + 1, 2]
                lx, ly, lz = links[before + 1, 3], links[before + 1, 4], links[before + 1, 5]
                ax, ay, az = links[before + 1, 6], links[before + 1, 7], links[before + 1, 8]
                if before >= 0:
                    copy_rows(motions_of[before], motions)
            px, py, pz = translation[j, 0], translation[j, 1], translation[j, 2]
            v, acc = dq[t, j], ddq[t, j]
            if is_slide[j]:
                px += rotation[j, 0, 2] * q[t, j]
                py += rotation[j, 1, 2] * q[t, j]
                pz += rotation[j, 2, 2] * q[t, j]
                link_rotation(rotation[j], 1.0, 0.0, r)
            else:
                link_rotation(rotation[j], np.cos(q[t, j]), np.sin(q[t, j]), r)
            ax, ay, az = origin_acceleration(ax, ay, az, lx, ly, lz, ox, oy, oz, px, py, pz)
            ax, ay, az = into_link(r, ax, ay, az)
            ox, oy, oz = into_link(r, ox, oy, oz)
            lx, ly, lz = into_link(r, lx, ly, lz)
            if is_slide[j]:
                ax += 2.0 * v * oy
                ay -= 2.0 * v * ox
                az += acc
            else:
                lx += v * oy
                ly -= v * ox
                lz += acc
                oz += v
            if is_left[j]:
                links[j + 1, 0], links[j + 1, 1], links[j + 1, 2] = ox, oy, oz
                links[j + 1, 3], links[j + 1, 4], links[j + 1, 5] = lx, ly, lz
                links[j + 1, 6], links[j + 1, 7], links[j + 1, 8] = ax, ay, az
            # [alpha]x + [omega]x[omega]x, shared by every joint that moves this link.
            bxx, byy, bzz = -(oy * oy + oz * oz), -(ox * ox + oz * oz), -(ox * ox + oy * oy)
            bxy, byx = ox * oy - lz, ox * oy + lz
            bxz, bzx = ox * oz + ly, ox * oz - ly
            byz, bzy = oy * oz - lx, oy * oz + lx
            slot = slots[PER_JOINT * j : PER_JOINT * (j + 1)]
            last = depths[j]
            for i in range(last + 1):
                if i < last:
                    wx, wy, wz = motions[i, 0], motions[i, 1], motions[i, 2]
                    tx, ty, tz = cross(wx, wy, wz, px, py, pz)
                    ux, uy, uz = motions[i, 3], motions[i, 4], motions[i, 5]
                    ux, uy, uz = ux + tx, uy + ty, uz + tz
                    wx, wy, wz = into_link(r, wx, wy, wz)
                    ux, uy, uz = into_link(r, ux, uy, uz)
                elif is_slide[j]:
                    wx, wy, wz, ux, uy, uz = 0.0, 0.0, 0.0, 0.0, 0.0, 1.0
                else:
                    wx, wy, wz, ux, uy, uz = 0.0, 0.0, 1.0, 0.0, 0.0, 0.0
                motions[i, 0], motions[i, 1], motions[i, 2] = wx, wy, wz
                motions[i, 3], motions[i, 4], motions[i, 5] = ux, uy, uz
                cx, cy, cz = cross(wx, wy, wz, ox, oy, oz)
                row = rows[paths[j, i]]
                row[slot[0]] = wx * lx + cx * ox
                row[slot[1]] = wx * ly + wy * lx + cx * oy + cy * ox
                row[slot[2]] = wx * lz + wz * lx + cx * oz + cz * ox
                row[slot[3]] = wy * ly + cy * oy
                row[slot[4]] = wy * lz + wz * ly + cy * oz + cz * oy
                row[slot[5]] = wz * lz + cz * oz
                row[slot[6]] = ux * bxx + uy * byx + uz * bzx + ay * wz - az * wy
                row[slot[7]] = ux * bxy + uy * byy + uz * bzy + az * wx - ax * wz
                row[slot[8]] = ux * bxz + uy * byz + uz * bzz + ax * wy - ay * wx
                row[slot[9]] = ux * ax + uy * ay + uz * az
            if is_left[j]:
                copy_rows(motions, motions_of[j])
            row = rows[j]
            row[slot[10]] = acc
            row[slot[11]] = v
            row[slot[12]] = coulomb_sign(v, coulomb_velocity)
            row[slot[13]] = 1.0
        for i in range(n):
            for k in range(c):
                out[t, i, k] = rows[i, k]


@kernel
def coulomb_sign(velocity: float, coulomb_velocity: float) -> float:
    """sgn(velocity), or its smooth form tanh(velocity / coulomb_velocity) when that is positive."""
    if coulomb_velocity > 0.0:
        return np.tanh(velocity / coulomb_velocity)
    return np.sign(velocity)
