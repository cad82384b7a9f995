"""Exact gradient of any function of the regressor with respect to the motion (reverse mode).

Given the seeds G = dL/dY, the derivatives dL/dq, dL/ddq and dL/d(ddq) follow in one sweep out along
the branches and one back, at about the cost of the regressor itself however many joints there are
(Griewank & Walther, "Evaluating Derivatives", 2008, ch. 3).

With the notation of regressor.py, and for the pair (joint i, link j) the symmetric 3 x 3 matrix S of
the six inertia seeds, g of the first moments and m of the mass, the pair contributes

    L = w' S alpha + c' S omega + g . (u x alpha + e x omega + a x w) + m u . a,
    c = w x omega,  e = u x omega,

whose derivatives with respect to w, u, omega, alpha and a are accumulated and carried to the base.
"""

import numpy as np
from numpy.typing import NDArray

from .chain import Chain
from .kinematics import (
    branching,
    cross,
    into_link,
    into_parent,
    kernel,
    link_rotation,
    moving,
    origin_acceleration,
)
from .parameters import PER_JOINT
from .regressor import column_slots, in_blocks

Array = NDArray[np.float64]

# Samples that take a thread much longer than it takes to start.
BLOCK = 512


def regressor_adjoint(
    chain: Chain,
    q: Array,
    dq: Array,
    ddq: Array,
    seeds: Array,
    columns: NDArray[np.int64] | None = None,
    coulomb_velocity: float = 0.0,
    threads: int | None = None,
) -> tuple[Array, Array, Array]:
    """dL/dq, dL/d(dq), dL/d(ddq), each (N, n), of an L with dL/dY = seeds.

    q, dq, ddq: (N, n) in rad, rad/s, rad/s² (m for slide joints).
    seeds: (N, n, c), for the regressor's columns in the order of ``columns`` (all when None). Joints
    whose seeds are all zero at a sample cost next to nothing there.
    coulomb_velocity: rad/s, as in ``regressor``; at 0 the Coulomb columns have no derivative.
    threads: workers (all cores when None); the result does not depend on it.
    """
    if (full := chain.followers) is not None:
        wanted = np.arange(PER_JOINT * chain.links) if columns is None else columns
        spread = seeds[:, full.leader] * full.ratio[:, None]
        spread[:, :, full.is_nobodys(wanted)] = 0.0
        motion = full.positions(q), full.motions(dq), full.motions(ddq)
        found = regressor_adjoint(
            chain.tree, *motion, spread, full.columns_in_tree(wanted), coulomb_velocity, threads
        )
        return full.folded(found[0]), full.folded(found[1]), full.folded(found[2])
    q, dq, ddq, seeds = (np.ascontiguousarray(x, dtype=np.float64) for x in (q, dq, ddq, seeds))
    slots, _ = column_slots(chain.joints, columns)
    bars = np.empty((3, *q.shape))
    arguments = (*chain.arrays[:-1], slots, coulomb_velocity)

    def fill(start: int, stop: int) -> None:
        # Contiguous as all else, whether it is a part or the whole: the kernel is compiled for one layout.
        part, own = slice(start, stop), np.empty((3, stop - start, chain.joints))
        _regressor_adjoint(*arguments, q[part], dq[part], ddq[part], seeds[part], own)
        bars[:, part] = own

    in_blocks(fill, len(q), threads, BLOCK)
    return bars[0], bars[1], bars[2]


@kernel
def _regressor_adjoint(
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
    seeds: Array,
    bars: Array,
) -> None:
    n = is_slide.size
    rotations = np.empty((n, 9))
    origins = np.empty((n, 3))
    links = np.empty((n + 1, 9))
    motions = np.empty((n, n, 6))
    motion_bars = np.empty((n, 6))
    # What branches have carried back to the links that they leave.
    link_waits, motion_waits = np.empty((n, 9)), np.empty((n, n, 6))
    active = np.empty(n, dtype=np.bool_)
    moves, is_left = moving(parent), branching(parent)
    # One place more than columns, zero: the seed of every column that was not asked for.
    rows = np.zeros((n, seeds.shape[2] + 1))
    for t in range(q.shape[0]):
        bars[:, t] = 0.0
        if not _load_rows(seeds[t], rows, active):
            continue
        _outward(
            parent,
            is_slide,
            rotation,
            translation,
            gravity,
            q[t],
            dq[t],
            ddq[t],
            moves,
            active,
            rotations,
            origins,
            links,
            motions,
        )
        for j in range(n):
            if is_left[j]:
                link_waits[j], motion_waits[j] = 0.0, 0.0
        motion_bars[:] = 0.0
        obx = oby = obz = lbx = lby = lbz = abx = aby = abz = 0.0
        for j in range(n - 1, -1, -1):
            before = parent[j]
            if is_left[j]:
                obx, oby, obz = obx + link_waits[j, 0], oby + link_waits[j, 1], obz + link_waits[j, 2]
                lbx, lby, lbz = lbx + link_waits[j, 3], lby + link_waits[j, 4], lbz + link_waits[j, 5]
                abx, aby, abz = abx + link_waits[j, 6], aby + link_waits[j, 7], abz + link_waits[j, 8]
                motion_bars += motion_waits[j]
            ox, oy, oz = links[j + 1, 0], links[j + 1, 1], links[j + 1, 2]
            lx, ly, lz = links[j + 1, 3], links[j + 1, 4], links[j + 1, 5]
            ax, ay, az = links[j + 1, 6], links[j + 1, 7], links[j + 1, 8]
            first = PER_JOINT * j
            for i in range(j + 1):
                if not (moves[j, i] and active[i]):
                    continue
                wx, wy, wz = motions[j, i, 0], motions[j, i, 1], motions[j, i, 2]
                ux, uy, uz = motions[j, i, 3], motions[j, i, 4], motions[j, i, 5]
                row = rows[i]
                xx, xy, xz = row[slots[first]], row[slots[first + 1]], row[slots[first + 2]]
                yy, yz, zz = row[slots[first + 3]], row[slots[first + 4]], row[slots[first + 5]]
                gx, gy, gz = row[slots[first + 6]], row[slots[first + 7]], row[slots[first + 8]]
                m = row[slots[first + 9]]
                cx, cy, cz = cross(wx, wy, wz, ox, oy, oz)
                ex, ey, ez = cross(ux, uy, uz, ox, oy, oz)
                cbx, cby, cbz = _times(xx, xy, xz, yy, yz, zz, ox, oy, oz)
                ebx, eby, ebz = cross(ox, oy, oz, gx, gy, gz)
                # Unit motion, angular: S alpha + omega x c_bar + g x a.
                s1x, s1y, s1z = _times(xx, xy, xz, yy, yz, zz, lx, ly, lz)
                s2x, s2y, s2z = cross(ox, oy, oz, cbx, cby, cbz)
                s3x, s3y, s3z = cross(gx, gy, gz, ax, ay, az)
                motion_bars[i, 0] += s1x + s2x + s3x
                motion_bars[i, 1] += s1y + s2y + s3y
                motion_bars[i, 2] += s1z + s2z + s3z
                # Unit motion, linear: alpha x g + omega x e_bar + m a.
                s1x, s1y, s1z = cross(lx, ly, lz, gx, gy, gz)
                s2x, s2y, s2z = cross(ox, oy, oz, ebx, eby, ebz)
                motion_bars[i, 3] += s1x + s2x + m * ax
                motion_bars[i, 4] += s1y + s2y + m * ay
                motion_bars[i, 5] += s1z + s2z + m * az
                # omega: S c + c_bar x w + g x e + e_bar x u.
                s1x, s1y, s1z = _times(xx, xy, xz, yy, yz, zz, cx, cy, cz)
                s2x, s2y, s2z = cross(cbx, cby, cbz, wx, wy, wz)
                s3x, s3y, s3z = cross(gx, gy, gz, ex, ey, ez)
                s4x, s4y, s4z = cross(ebx, eby, ebz, ux, uy, uz)
                obx += s1x + s2x + s3x + s4x
                oby += s1y + s2y + s3y + s4y
                obz += s1z + s2z + s3z + s4z
                # alpha: S w + g x u.
                s1x, s1y, s1z = _times(xx, xy, xz, yy, yz, zz, wx, wy, wz)
                s2x, s2y, s2z = cross(gx, gy, gz, ux, uy, uz)
                lbx += s1x + s2x
                lby += s1y + s2y
                lbz += s1z + s2z
                # a: w x g + m u.
                s1x, s1y, s1z = cross(wx, wy, wz, gx, gy, gz)
                abx += s1x + m * ux
                aby += s1y + m * uy
                abz += s1z + m * uz
            v = dq[t, j]
            q_bar = 0.0
            dq_bar = rows[j, slots[first + 11]]
            ddq_bar = rows[j, slots[first + 10]]
            if coulomb_velocity > 0.0:
                smooth = np.tanh(v / coulomb_velocity)
                dq_bar += rows[j, slots[first + 12]] * (1.0 - smooth * smooth) / coulomb_velocity
            if is_slide[j]:
                # a = R'(...) + 2 v omega x z + acc z.
                dq_bar += 2.0 * (abx * oy - aby * ox)
                ddq_bar += abz
                obx -= 2.0 * v * aby
                oby += 2.0 * v * abx
            else:
                # omega = R'(...) + v z, alpha = R'(...) + v omega x z + acc z; every y = R'x turns by y x z.
                dq_bar += obz + lbx * oy - lby * ox
                ddq_bar += lbz
                obx -= v * lby
                oby += v * lbx
                q_bar += obx * oy - oby * ox + abx * ay - aby * ax
                q_bar += lbx * (ly + v * ox) - lby * (lx - v * oy)
                for i in range(j):
                    if moves[j, i] and active[i]:
                        q_bar += motion_bars[i, 0] * motions[j, i, 1] - motion_bars[i, 1] * motions[j, i, 0]
                        q_bar += motion_bars[i, 3] * motions[j, i, 4] - motion_bars[i, 4] * motions[j, i, 3]
            r = rotations[j]
            px, py, pz = origins[j, 0], origins[j, 1], origins[j, 2]
            ox, oy, oz = links[before + 1, 0], links[before + 1, 1], links[before + 1, 2]
            lx, ly, lz = links[before + 1, 3], links[before + 1, 4], links[before + 1, 5]
            obx, oby, obz = into_parent(r, obx, oby, obz)
            lbx, lby, lbz = into_parent(r, lbx, lby, lbz)
            abx, aby, abz = into_parent(r, abx, aby, abz)
            # a_parent + alpha x p + omega x s, with s = omega x p.
            sx, sy, sz = cross(ox, oy, oz, px, py, pz)
            sbx, sby, sbz = cross(abx, aby, abz, ox, oy, oz)
            s1x, s1y, s1z = cross(sx, sy, sz, abx, aby, abz)
            s2x, s2y, s2z = cross(px, py, pz, sbx, sby, sbz)
            obx, oby, obz = obx + s1x + s2x, oby + s1y + s2y, obz + s1z + s2z
            s1x, s1y, s1z = cross(px, py, pz, abx, aby, abz)
            lbx, lby, lbz = lbx + s1x, lby + s1y, lbz + s1z
            s1x, s1y, s1z = cross(abx, aby, abz, lx, ly, lz)
            s2x, s2y, s2z = cross(sbx, sby, sbz, ox, oy, oz)
            pbx, pby, pbz = s1x + s2x, s1y + s2y, s1z + s2z
            for i in range(j):
                if not (moves[j, i] and active[i]):
                    continue
                wbx, wby, wbz = into_parent(r, motion_bars[i, 0], motion_bars[i, 1], motion_bars[i, 2])
                ubx, uby, ubz = into_parent(r, motion_bars[i, 3], motion_bars[i, 4], motion_bars[i, 5])
                wx, wy, wz = motions[before, i, 0], motions[before, i, 1], motions[before, i, 2]
                s1x, s1y, s1z = cross(px, py, pz, ubx, uby, ubz)
                s2x, s2y, s2z = cross(ubx, uby, ubz, wx, wy, wz)
                motion_bars[i, 0], motion_bars[i, 1], motion_bars[i, 2] = wbx + s1x, wby + s1y, wbz + s1z
                motion_bars[i, 3], motion_bars[i, 4], motion_bars[i, 5] = ubx, uby, ubz
                pbx, pby, pbz = pbx + s2x, pby + s2y, pbz + s2z
            if is_slide[j]:
                q_bar += pbx * rotation[j, 0, 2] + pby * rotation[j, 1, 2] + pbz * rotation[j, 2, 2]
            bars[0, t, j], bars[1, t, j], bars[2, t, j] = q_bar, dq_bar, ddq_bar
            if before == j - 1:
                continue
            if before >= 0:
                for k, bar in enumerate((obx, oby, obz, lbx, lby, lbz, abx, aby, abz)):
                    link_waits[before, k] += bar
                for i in range(before + 1):
                    for k in range(6):
                        motion_waits[before, i, k] += motion_bars[i, k]
            motion_bars[:] = 0.0
            obx = oby = obz = lbx = lby = lbz = abx = aby = abz = 0.0


@kernel
def _outward(
    parent: NDArray[np.int64],
    is_slide: NDArray[np.bool_],
    rotation: Array,
    translation: Array,
    gravity: Array,
    q: Array,
    dq: Array,
    ddq: Array,
    moves: NDArray[np.bool_],
    active: NDArray[np.bool_],
    rotations: Array,
    origins: Array,
    links: Array,
    motions: Array,
) -> None:
    """Poses, link motions (row j + 1 is link j, row 0 the base) and unit motions of the active joints."""
    links[0, :] = 0.0
    links[0, 6], links[0, 7], links[0, 8] = -gravity[0], -gravity[1], -gravity[2]
    for j in range(is_slide.size):
        r = rotations[j]
        px, py, pz = translation[j, 0], translation[j, 1], translation[j, 2]
        v, acc = dq[j], ddq[j]
        if is_slide[j]:
            px += rotation[j, 0, 2] * q[j]
            py += rotation[j, 1, 2] * q[j]
            pz += rotation[j, 2, 2] * q[j]
            link_rotation(rotation[j], 1.0, 0.0, r)
        else:
            link_rotation(rotation[j], np.cos(q[j]), np.sin(q[j]), r)
        origins[j, 0], origins[j, 1], origins[j, 2] = px, py, pz
        before = parent[j]
        ox, oy, oz = links[before + 1, 0], links[before + 1, 1], links[before + 1, 2]
        lx, ly, lz = links[before + 1, 3], links[before + 1, 4], links[before + 1, 5]
        ax, ay, az = links[before + 1, 6], links[before + 1, 7], links[before + 1, 8]
        ax, ay, az = origin_acceleration(ax, ay, az, lx, ly, lz, ox, oy, oz, px, py, pz)
        ax, ay, az = into_link(r, ax, ay, az)
        ox, oy, oz = into_link(r, ox, oy, oz)
        lx, ly, lz = into_link(r, lx, ly, lz)
        for i in range(j):
            if moves[j, i] and active[i]:
                wx, wy, wz = motions[before, i, 0], motions[before, i, 1], motions[before, i, 2]
                tx, ty, tz = cross(wx, wy, wz, px, py, pz)
                ux, uy, uz = motions[before, i, 3], motions[before, i, 4], motions[before, i, 5]
                ux, uy, uz = ux + tx, uy + ty, uz + tz
                motions[j, i, 0], motions[j, i, 1], motions[j, i, 2] = into_link(r, wx, wy, wz)
                motions[j, i, 3], motions[j, i, 4], motions[j, i, 5] = into_link(r, ux, uy, uz)
        motions[j, j, :] = 0.0
        if is_slide[j]:
            ax += 2.0 * v * oy
            ay -= 2.0 * v * ox
            az += acc
            motions[j, j, 5] = 1.0
        else:
            lx += v * oy
            ly -= v * ox
            lz += acc
            oz += v
            motions[j, j, 2] = 1.0
        links[j + 1, 0], links[j + 1, 1], links[j + 1, 2] = ox, oy, oz
        links[j + 1, 3], links[j + 1, 4], links[j + 1, 5] = lx, ly, lz
        links[j + 1, 6], links[j + 1, 7], links[j + 1, 8] = ax, ay, az


@kernel
def _load_rows(seeds: Array, rows: Array, active: NDArray[np.bool_]) -> bool:
    """Copy the seeds, and mark the joints that have one other than zero; whether there is any."""
    found = False
    for i in range(seeds.shape[0]):
        active[i] = False
        for k in range(seeds.shape[1]):
            value = seeds[i, k]
            rows[i, k] = value
            if value != 0.0:
                active[i] = True
        found = found or active[i]
    return found


@kernel
def _times(
    xx: float, xy: float, xz: float, yy: float, yz: float, zz: float, x: float, y: float, z: float
) -> tuple[float, float, float]:
    """A symmetric 3 x 3 matrix times a vector."""
    return xx * x + xy * y + xz * z, xy * x + yy * y + yz * z, xz * x + yz * y + zz * z
