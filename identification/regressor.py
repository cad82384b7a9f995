"""Batched inverse-dynamics regressor: tau = Y(q, dq, ddq) theta, linear in the standard parameters.

The row of joint i in the block of link j is the power of link j's wrench along joint i's unit
motion, taken in link j's frame (Atkeson, An & Hollerbach 1986; Khalil & Dombre 2004, ch. 9). With
omega, alpha, a the link's angular velocity, angular acceleration and origin acceleration less
gravity, and (w, u) the unit motion of joint i at link j's origin (angular, linear):

    inertia entries  w' E alpha + (w x omega)' E omega      for each of the six unit inertias E
    first moments    u x alpha + (u x omega) x omega + a x w
    mass             u . a

Only the 6-vectors (w, u) travel down the chain, never 6 x 10 matrices.
"""

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .chain import Chain
from .kinematics import cross, into_link, kernel, link_rotation, origin_acceleration
from .parameters import PER_JOINT

Array = NDArray[np.float64]

BLOCK = 512


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
    columns: (c,) indices into the standard vector (all 14 n when None); only these are written.
    coulomb_velocity: rad/s; 0 gives sgn(dq) for Coulomb columns, else tanh(dq / coulomb_velocity).
    threads: workers (all cores when None); the result does not depend on it.
    out: written to when given, shape (N, n, c), C order.
    """
    q, dq, ddq = (np.ascontiguousarray(x, dtype=np.float64) for x in (q, dq, ddq))
    slots, count = column_slots(chain.joints, columns)
    if out is None:
        out = np.empty((len(q), chain.joints, count))
    arguments = (chain.is_slide, chain.rotation, chain.translation, chain.gravity, slots, coulomb_velocity)

    def fill(start: int, stop: int) -> None:
        part = slice(start, stop)
        _regressor(*arguments, q[part], dq[part], ddq[part], out[part])

    in_blocks(fill, len(q), threads)
    return out


def column_slots(joints: int, columns: NDArray[np.int64] | None) -> tuple[NDArray[np.int64], int]:
    """Where each standard column is written, (14 n,) with -1 for "not at all", and how many are."""
    total = PER_JOINT * joints
    if columns is None:
        return np.arange(total), total
    slots = np.full(total, -1, dtype=np.int64)
    slots[columns] = np.arange(len(columns))
    return slots, len(columns)


def in_blocks(work: Callable[[int, int], None], samples: int, threads: int | None) -> None:
    """Call work(start, stop) over fixed blocks of samples, on that many threads (all cores: None)."""
    workers = min(threads or os.cpu_count() or 1, -(-samples // BLOCK))
    if workers <= 1:
        work(0, samples)
        return
    edges = np.linspace(0, samples, workers + 1).astype(int)
    with ThreadPoolExecutor(workers) as pool:
        list(pool.map(work, edges[:-1], edges[1:]))


@kernel
def _regressor(  # type: ignore[no-untyped-def]
    is_slide, rotation, translation, gravity, slots, coulomb_velocity, q, dq, ddq, out
) -> Any:
    n = is_slide.size
    r = np.empty(9)
    motions = np.empty((n, 6))
    for t in range(q.shape[0]):
        out[t] = 0.0
        ox = oy = oz = lx = ly = lz = 0.0
        ax, ay, az = -gravity[0], -gravity[1], -gravity[2]
        for j in range(n):
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
            for i in range(j):
                wx, wy, wz = motions[i, 0], motions[i, 1], motions[i, 2]
                tx, ty, tz = cross(wx, wy, wz, px, py, pz)
                ux, uy, uz = motions[i, 3] + tx, motions[i, 4] + ty, motions[i, 5] + tz
                motions[i, 0], motions[i, 1], motions[i, 2] = into_link(r, wx, wy, wz)
                motions[i, 3], motions[i, 4], motions[i, 5] = into_link(r, ux, uy, uz)
            motions[j, :] = 0.0
            if is_slide[j]:
                ax += 2.0 * v * oy
                ay -= 2.0 * v * ox
                az += acc
                motions[j, 5] = 1.0
            else:
                lx += v * oy
                ly -= v * ox
                lz += acc
                oz += v
                motions[j, 2] = 1.0
            first = PER_JOINT * j
            for i in range(j + 1):
                wx, wy, wz = motions[i, 0], motions[i, 1], motions[i, 2]
                ux, uy, uz = motions[i, 3], motions[i, 4], motions[i, 5]
                cx, cy, cz = cross(wx, wy, wz, ox, oy, oz)
                ex, ey, ez = cross(ux, uy, uz, ox, oy, oz)
                fx, fy, fz = cross(ux, uy, uz, lx, ly, lz)
                gx, gy, gz = cross(ex, ey, ez, ox, oy, oz)
                hx, hy, hz = cross(ax, ay, az, wx, wy, wz)
                row = out[t, i]
                _put(row, slots[first], wx * lx + cx * ox)
                _put(row, slots[first + 1], wx * ly + wy * lx + cx * oy + cy * ox)
                _put(row, slots[first + 2], wx * lz + wz * lx + cx * oz + cz * ox)
                _put(row, slots[first + 3], wy * ly + cy * oy)
                _put(row, slots[first + 4], wy * lz + wz * ly + cy * oz + cz * oy)
                _put(row, slots[first + 5], wz * lz + cz * oz)
                _put(row, slots[first + 6], fx + gx + hx)
                _put(row, slots[first + 7], fy + gy + hy)
                _put(row, slots[first + 8], fz + gz + hz)
                _put(row, slots[first + 9], ux * ax + uy * ay + uz * az)
            row = out[t, j]
            _put(row, slots[first + 10], acc)
            _put(row, slots[first + 11], v)
            _put(row, slots[first + 12], coulomb_sign(v, coulomb_velocity))
            _put(row, slots[first + 13], 1.0)


@kernel
def _put(row, slot, value):  # type: ignore[no-untyped-def]
    if slot >= 0:
        row[slot] = value


@kernel
def coulomb_sign(velocity, coulomb_velocity):  # type: ignore[no-untyped-def]
    """sgn(velocity), or its smooth form tanh(velocity / coulomb_velocity) when that is positive."""
    if coulomb_velocity > 0.0:
        return np.tanh(velocity / coulomb_velocity)
    return np.sign(velocity)
