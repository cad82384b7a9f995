"""Mass matrix and bias torque of one state, in one pass: what a simulation asks for at every step.

Bias by the recursive Newton-Euler algorithm, the mass matrix by composite rigid bodies (Featherstone, "Rigid
Body Dynamics Algorithms", 2008, ch. 5 and 6), both about link origins. Nothing is allocated.
"""

import numpy as np
from numpy.typing import NDArray

from .kinematics import cross, into_link, into_parent, kernel, link_rotation, origin_acceleration
from .springs import pull

Array = NDArray[np.float64]

# Numbers of scratch a link: rotation, origin, motion, wrench, composite body.
SCRATCH = 9 + 3 + 9 + 6 + 10
_ORIGIN, _MOTION, _WRENCH, _BODY = 9, 12, 21, 27


@kernel
def mass_and_bias(
    parent: NDArray[np.int64],
    is_slide: NDArray[np.bool_],
    rotation: Array,
    translation: Array,
    gravity: Array,
    springs: Array,
    table: Array,
    q: Array,
    dq: Array,
    scratch: Array,
    mass: Array,
    bias: Array,
) -> None:
    """M(q) with rotors into ``mass`` [:n, :n], and the torque of motion, gravity, springs and offsets into
    ``bias`` (n,).

    table: (n, 14) standard parameters, of which viscous and Coulomb friction are left out. q, dq: (n,).
    scratch: (n, SCRATCH).
    """
    n = is_slide.size
    for j in range(n):
        _forward(j, parent, is_slide, rotation, translation, gravity, table, q, dq, scratch)
    for j in range(n - 1, -1, -1):
        own = scratch[j]
        torque = own[_WRENCH + 2] if is_slide[j] else own[_WRENCH + 5]
        torque += pull(springs[j, 0], springs[j, 1], springs[j, 2], q[j] - springs[j, 3])
        bias[j] = torque + table[j, 13]
        _column(j, parent, is_slide, table[j, 10], scratch, mass)
        if parent[j] >= 0:
            _hand_down(own, scratch[parent[j]])


@kernel
def _forward(
    j: int,
    parent: NDArray[np.int64],
    is_slide: NDArray[np.bool_],
    rotation: Array,
    translation: Array,
    gravity: Array,
    table: Array,
    q: Array,
    dq: Array,
    scratch: Array,
) -> None:
    """A link's rotation, origin and motion, the wrench that this motion takes, and its own inertia."""
    ox = oy = oz = lx = ly = lz = 0.0
    ax, ay, az = -gravity[0], -gravity[1], -gravity[2]
    if parent[j] >= 0:
        before = scratch[parent[j]]
        ox, oy, oz = before[_MOTION], before[_MOTION + 1], before[_MOTION + 2]
        lx, ly, lz = before[_MOTION + 3], before[_MOTION + 4], before[_MOTION + 5]
        ax, ay, az = before[_MOTION + 6], before[_MOTION + 7], before[_MOTION + 8]
    own = scratch[j]
    px, py, pz = translation[j, 0], translation[j, 1], translation[j, 2]
    v = dq[j]
    if is_slide[j]:
        px += rotation[j, 0, 2] * q[j]
        py += rotation[j, 1, 2] * q[j]
        pz += rotation[j, 2, 2] * q[j]
        link_rotation(rotation[j], 1.0, 0.0, own)
    else:
        link_rotation(rotation[j], np.cos(q[j]), np.sin(q[j]), own)
    own[_ORIGIN], own[_ORIGIN + 1], own[_ORIGIN + 2] = px, py, pz
    ax, ay, az = origin_acceleration(ax, ay, az, lx, ly, lz, ox, oy, oz, px, py, pz)
    ax, ay, az = into_link(own, ax, ay, az)
    ox, oy, oz = into_link(own, ox, oy, oz)
    lx, ly, lz = into_link(own, lx, ly, lz)
    if is_slide[j]:
        ax += 2.0 * v * oy
        ay -= 2.0 * v * ox
    else:
        lx += v * oy
        ly -= v * ox
        oz += v
    own[_MOTION], own[_MOTION + 1], own[_MOTION + 2] = ox, oy, oz
    own[_MOTION + 3], own[_MOTION + 4], own[_MOTION + 5] = lx, ly, lz
    own[_MOTION + 6], own[_MOTION + 7], own[_MOTION + 8] = ax, ay, az
    xx, xy, xz, yy, yz, zz = table[j, 0], table[j, 1], table[j, 2], table[j, 3], table[j, 4], table[j, 5]
    mx, my, mz, m = table[j, 6], table[j, 7], table[j, 8], table[j, 9]
    fx, fy, fz = origin_acceleration(0.0, 0.0, 0.0, lx, ly, lz, ox, oy, oz, mx, my, mz)
    hx, hy, hz = xx * ox + xy * oy + xz * oz, xy * ox + yy * oy + yz * oz, xz * ox + yz * oy + zz * oz
    gx, gy, gz = cross(ox, oy, oz, hx, hy, hz)
    cx, cy, cz = cross(mx, my, mz, ax, ay, az)
    own[_WRENCH], own[_WRENCH + 1], own[_WRENCH + 2] = fx + m * ax, fy + m * ay, fz + m * az
    own[_WRENCH + 3] = xx * lx + xy * ly + xz * lz + gx + cx
    own[_WRENCH + 4] = xy * lx + yy * ly + yz * lz + gy + cy
    own[_WRENCH + 5] = xz * lx + yz * ly + zz * lz + gz + cz
    for k in range(10):
        own[_BODY + k] = table[j, k]


@kernel
def _column(
    j: int,
    parent: NDArray[np.int64],
    is_slide: NDArray[np.bool_],
    rotor: float,
    scratch: Array,
    mass: Array,
) -> None:
    """Row and column j of the mass matrix as far as the joints before it: all that it carries is one body."""
    own = scratch[j]
    if is_slide[j]:
        fx, fy, fz = 0.0, 0.0, own[_BODY + 9]
        nx, ny, nz = own[_BODY + 7], -own[_BODY + 6], 0.0
    else:
        fx, fy, fz = -own[_BODY + 7], own[_BODY + 6], 0.0
        nx, ny, nz = own[_BODY + 2], own[_BODY + 4], own[_BODY + 5]
    mass[j, j] = (fz if is_slide[j] else nz) + rotor
    for i in range(j):
        mass[i, j] = mass[j, i] = 0.0
    i = j
    while parent[i] >= 0:
        link = scratch[i]
        fx, fy, fz = into_parent(link, fx, fy, fz)
        nx, ny, nz = into_parent(link, nx, ny, nz)
        cx, cy, cz = cross(link[_ORIGIN], link[_ORIGIN + 1], link[_ORIGIN + 2], fx, fy, fz)
        nx, ny, nz = nx + cx, ny + cy, nz + cz
        i = parent[i]
        mass[i, j] = mass[j, i] = fz if is_slide[i] else nz


@kernel
def _hand_down(own: Array, before: Array) -> None:
    """Add a link's wrench and composite body, in its parent's frame, to its parent's."""
    px, py, pz = own[_ORIGIN], own[_ORIGIN + 1], own[_ORIGIN + 2]
    fx, fy, fz = into_parent(own, own[_WRENCH], own[_WRENCH + 1], own[_WRENCH + 2])
    nx, ny, nz = into_parent(own, own[_WRENCH + 3], own[_WRENCH + 4], own[_WRENCH + 5])
    cx, cy, cz = cross(px, py, pz, fx, fy, fz)
    before[_WRENCH] += fx
    before[_WRENCH + 1] += fy
    before[_WRENCH + 2] += fz
    before[_WRENCH + 3] += nx + cx
    before[_WRENCH + 4] += ny + cy
    before[_WRENCH + 5] += nz + cz
    xx, xy, xz = own[_BODY], own[_BODY + 1], own[_BODY + 2]
    yy, yz, zz = own[_BODY + 3], own[_BODY + 4], own[_BODY + 5]
    m = own[_BODY + 9]
    mx, my, mz = into_parent(own, own[_BODY + 6], own[_BODY + 7], own[_BODY + 8])
    # R J R' by its columns: R (J R'), J symmetric.
    ax, ay, az = into_parent(own, xx, xy, xz)
    bx, by, bz = into_parent(own, xy, yy, yz)
    cx, cy, cz = into_parent(own, xz, yz, zz)
    xx, xy, xz = into_parent(own, ax, bx, cx)
    _, yy, yz = into_parent(own, ay, by, cy)
    _, _, zz = into_parent(own, az, bz, cz)
    # About the parent's origin: + (2 p·c + m p²) 1 - p c' - c p' - m p p', c the first moment.
    centre = 2.0 * (px * mx + py * my + pz * mz) + m * (px * px + py * py + pz * pz)
    before[_BODY] += xx + centre - 2.0 * px * mx - m * px * px
    before[_BODY + 1] += xy - px * my - py * mx - m * px * py
    before[_BODY + 2] += xz - px * mz - pz * mx - m * px * pz
    before[_BODY + 3] += yy + centre - 2.0 * py * my - m * py * py
    before[_BODY + 4] += yz - py * mz - pz * my - m * py * pz
    before[_BODY + 5] += zz + centre - 2.0 * pz * mz - m * pz * pz
    before[_BODY + 6] += mx + m * px
    before[_BODY + 7] += my + m * py
    before[_BODY + 8] += mz + m * pz
    before[_BODY + 9] += m
