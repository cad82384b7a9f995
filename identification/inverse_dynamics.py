"""Batched inverse dynamics by the recursive Newton-Euler algorithm.

Luh, Walker & Paul (1980), in link frames and about link origins, so that the wrench is linear in
the standard parameters (Khalil & Dombre 2004, ch. 9). It gives regressor @ parameters, and what the
joints' springs need, without forming the regressor.
"""

import numpy as np
from numpy.typing import NDArray

from .chain import Chain
from .kinematics import cross, into_link, into_parent, kernel, link_rotation, origin_acceleration
from .parameters import PER_JOINT
from .regressor import BLOCK, coulomb_sign, in_blocks
from .springs import pull

Array = NDArray[np.float64]


def inverse_dynamics(
    chain: Chain,
    parameters: Array,
    q: Array,
    dq: Array,
    ddq: Array,
    coulomb_velocity: float = 0.0,
    threads: int | None = None,
) -> Array:
    """Joint torques, shape (N, n), N·m (N for slide joints).

    parameters: (14 links,) standard parameters. q, dq, ddq: (N, n) rad, rad/s, rad/s² (m for slides).
    coulomb_velocity: rad/s; 0 gives fc sgn(dq), else fc tanh(dq / coulomb_velocity).
    threads: workers (all cores when None); the result does not depend on it.
    """
    if (full := chain.followers) is not None:
        table = parameters.reshape(chain.links, PER_JOINT)[full.place]
        motion = full.positions(q), full.motions(dq), full.motions(ddq)
        return full.folded(inverse_dynamics(chain.tree, table, *motion, coulomb_velocity, threads))
    q, dq, ddq = (np.ascontiguousarray(x, dtype=np.float64) for x in (q, dq, ddq))
    out = np.empty(q.shape)
    table = np.ascontiguousarray(parameters, dtype=np.float64).reshape(chain.joints, PER_JOINT)
    arguments = (*chain.arrays, table, coulomb_velocity)

    def fill(start: int, stop: int) -> None:
        part = slice(start, stop)
        _inverse_dynamics(*arguments, q[part], dq[part], ddq[part], out[part])

    in_blocks(fill, len(q), threads, BLOCK)
    return out


def mass_matrices(chain: Chain, parameters: Array, q: Array, threads: int | None = None) -> Array:
    """(K, n, n) kg·m² (kg) at poses (K, n), rotors included, by unit accelerations of one joint at a time."""
    still = np.zeros_like(q)
    rest = inverse_dynamics(chain, parameters, q, still, still, threads=threads)
    columns = [
        inverse_dynamics(chain, parameters, q, still, still + unit, threads=threads) - rest
        for unit in np.eye(chain.joints)
    ]
    return np.stack(columns, axis=2)


@kernel
def _inverse_dynamics(
    parent: NDArray[np.int64],
    is_slide: NDArray[np.bool_],
    rotation: Array,
    translation: Array,
    gravity: Array,
    springs: Array,
    table: Array,
    coulomb_velocity: float,
    q: Array,
    dq: Array,
    ddq: Array,
    out: Array,
) -> None:
    n = is_slide.size
    rotations = np.empty((n, 9))
    origins = np.empty((n, 3))
    wrenches = np.empty((n, 6))
    # Row j + 1 is link j, row 0 the base.
    links = np.zeros((n + 1, 9))
    links[0, 6], links[0, 7], links[0, 8] = -gravity[0], -gravity[1], -gravity[2]
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
            r = rotations[j]
            px, py, pz = translation[j, 0], translation[j, 1], translation[j, 2]
            v, acc = dq[t, j], ddq[t, j]
            if is_slide[j]:
                px += rotation[j, 0, 2] * q[t, j]
                py += rotation[j, 1, 2] * q[t, j]
                pz += rotation[j, 2, 2] * q[t, j]
                link_rotation(rotation[j], 1.0, 0.0, r)
            else:
                link_rotation(rotation[j], np.cos(q[t, j]), np.sin(q[t, j]), r)
            origins[j, 0], origins[j, 1], origins[j, 2] = px, py, pz
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
            links[j + 1, 0], links[j + 1, 1], links[j + 1, 2] = ox, oy, oz
            links[j + 1, 3], links[j + 1, 4], links[j + 1, 5] = lx, ly, lz
            links[j + 1, 6], links[j + 1, 7], links[j + 1, 8] = ax, ay, az
            xx, xy, xz = table[j, 0], table[j, 1], table[j, 2]
            yy, yz, zz = table[j, 3], table[j, 4], table[j, 5]
            mx, my, mz, mass = table[j, 6], table[j, 7], table[j, 8], table[j, 9]
            fx, fy, fz = origin_acceleration(0.0, 0.0, 0.0, lx, ly, lz, ox, oy, oz, mx, my, mz)
            hx, hy, hz = xx * ox + xy * oy + xz * oz, xy * ox + yy * oy + yz * oz, xz * ox + yz * oy + zz * oz
            gx, gy, gz = cross(ox, oy, oz, hx, hy, hz)
            cx, cy, cz = cross(mx, my, mz, ax, ay, az)
            wrenches[j, 0], wrenches[j, 1], wrenches[j, 2] = fx + mass * ax, fy + mass * ay, fz + mass * az
            wrenches[j, 3] = xx * lx + xy * ly + xz * lz + gx + cx
            wrenches[j, 4] = xy * lx + yy * ly + yz * lz + gy + cy
            wrenches[j, 5] = xz * lx + yz * ly + zz * lz + gz + cz
        for j in range(n - 1, -1, -1):
            fx, fy, fz = wrenches[j, 0], wrenches[j, 1], wrenches[j, 2]
            nx, ny, nz = wrenches[j, 3], wrenches[j, 4], wrenches[j, 5]
            v = dq[t, j]
            torque = fz if is_slide[j] else nz
            torque += table[j, 10] * ddq[t, j] + table[j, 11] * v
            torque += pull(springs[j, 0], springs[j, 1], springs[j, 2], q[t, j] - springs[j, 3])
            out[t, j] = torque + table[j, 12] * coulomb_sign(v, coulomb_velocity) + table[j, 13]
            before = parent[j]
            if before >= 0:
                fx, fy, fz = into_parent(rotations[j], fx, fy, fz)
                nx, ny, nz = into_parent(rotations[j], nx, ny, nz)
                cx, cy, cz = cross(origins[j, 0], origins[j, 1], origins[j, 2], fx, fy, fz)
                wrenches[before, 0] += fx
                wrenches[before, 1] += fy
                wrenches[before, 2] += fz
                wrenches[before, 3] += nx + cx
                wrenches[before, 4] += ny + cy
                wrenches[before, 5] += nz + cz
