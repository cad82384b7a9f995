"""Scalar kernels on 3-vectors that the regressor and inverse dynamics are compiled from."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .compiled import njit

Array = NDArray[np.float64]


def kernel(function: Any) -> Any:
    """Compile for any thread, cached on disk.

    Products and sums may fuse, nothing may be reordered: results repeat bit for bit.
    """
    return njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})(function)


@kernel
def cross(ax: float, ay: float, az: float, bx: float, by: float, bz: float) -> tuple[float, float, float]:
    """a × b as three scalars."""
    return ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx


@kernel
def copy_row(row: Any, out: Any) -> None:
    """out = row, both (k,): numba compiles an assignment of arrays with seconds' worth of error messages."""
    for i in range(row.size):
        out[i] = row[i]


@kernel
def copy_rows(rows: Array, out: Array) -> None:
    """The same of arrays (m, k)."""
    for i in range(rows.shape[0]):
        copy_row(rows[i], out[i])


@kernel
def moving(parent: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Which joints i move which links j, [j, i] of (n, n): those between the base and the link."""
    n = parent.size
    out = np.zeros((n, n), dtype=np.bool_)
    for j in range(n):
        if parent[j] >= 0:
            copy_row(out[parent[j]], out[j])
        out[j, j] = True
    return out


@kernel
def branching(parent: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Whether a branch leaves each link (n,) that begins after other joints."""
    out = np.zeros(parent.size, dtype=np.bool_)
    for j in range(parent.size):
        if 0 <= parent[j] < j - 1:
            out[parent[j]] = True
    return out


@kernel
def paths_to(parent: NDArray[np.int64]) -> tuple[NDArray[np.uint64], NDArray[np.int64]]:
    """The joints that move each link j, base to link, [j, : depth + 1] of (n, n); and the depths (n,)."""
    n = parent.size
    paths, depths = np.zeros((n, n), dtype=np.uint64), np.zeros(n, dtype=np.int64)
    for j in range(n):
        if parent[j] >= 0:
            depths[j] = depths[parent[j]] + 1
            copy_row(paths[parent[j]], paths[j])
        paths[j, depths[j]] = j
    return paths, depths


@kernel
def link_rotation(fixed: Array, c: float, s: float, out: Array) -> None:
    """out (9,) = fixed (3, 3) times a turn about z by the angle of cosine c and sine s, row-major."""
    for row in range(3):
        x, y = fixed[row, 0], fixed[row, 1]
        out[3 * row] = x * c + y * s
        out[3 * row + 1] = y * c - x * s
        out[3 * row + 2] = fixed[row, 2]


@kernel
def into_link(r: Array, x: float, y: float, z: float) -> tuple[float, float, float]:
    """R' v: a vector of the parent frame, in the link frame."""
    return (
        r[0] * x + r[3] * y + r[6] * z,
        r[1] * x + r[4] * y + r[7] * z,
        r[2] * x + r[5] * y + r[8] * z,
    )


@kernel
def into_parent(r: Array, x: float, y: float, z: float) -> tuple[float, float, float]:
    """R v: a vector of the link frame, in the parent frame."""
    return (
        r[0] * x + r[1] * y + r[2] * z,
        r[3] * x + r[4] * y + r[5] * z,
        r[6] * x + r[7] * y + r[8] * z,
    )


@kernel
def origin_acceleration(
    ax: float,
    ay: float,
    az: float,
    alx: float,
    aly: float,
    alz: float,
    ox: float,
    oy: float,
    oz: float,
    px: float,
    py: float,
    pz: float,
) -> tuple[float, float, float]:
    """a + α × p + ω × (ω × p)."""
    tx, ty, tz = cross(alx, aly, alz, px, py, pz)
    bx, by, bz = cross(ox, oy, oz, px, py, pz)
    cx, cy, cz = cross(ox, oy, oz, bx, by, bz)
    return ax + tx + cx, ay + ty + cy, az + tz + cz
