"""A force on a link, and the torques it loads the joints before with.

Kernels take a table (links, 17) of the full tree: whether a joint slides, its link's translation and rotation
at q = 0, its parent, and the robot's joint that moves it, with ratio and offset. A link is one of that table.
"""

import numpy as np
from numpy.typing import NDArray

from identification.chain import Chain
from identification.kinematics import cross, into_link, into_parent, kernel, link_rotation

Array = NDArray[np.float64]

# Columns of the table of links.
LINK, PARENT, LEADER, RATIO, OFFSET = 17, 13, 14, 15, 16
# Where a link ends, if nothing follows it, m.
SHORTEST_ARM = 0.1
# What of a load shows no more than this beside the rest is left out.
REDUNDANT = 1e-3


def push_point(chain: Chain, joint: int) -> tuple[Array, Array]:
    """Where the link is pushed, (3,) m in its frame, and the direction (3,) of a positive torque.

    It is where the next joint sits, the first of several, or a tenth of a metre out; its distance from the
    axis is the lever.
    """
    end = np.zeros(3)
    tree = chain.tree
    for following in tree.children(int(chain.in_tree[joint]))[:1]:
        end[:2] = tree.translation[following, :2]
    if np.linalg.norm(end) < SHORTEST_ARM:
        end = np.array([SHORTEST_ARM, 0.0, 0.0])
    if chain.is_slide[joint]:
        return end, np.array([0.0, 0.0, 1.0])
    return end, np.array([-end[1], end[0], 0.0]) / np.linalg.norm(end)


def link_table(chain: Chain) -> Array:
    """The table (links, 17) that kernels take."""
    tree, full = chain.tree, chain.followers
    ratio, offset = np.ones(chain.links), np.zeros(chain.links)
    if full is not None:
        ratio, offset = full.ratio, full.offset
    flat = tree.rotation.reshape(chain.links, 9)
    columns = [tree.is_slide, tree.translation, flat, tree.parent, chain.leaders, ratio, offset]
    return np.ascontiguousarray(np.column_stack(columns), dtype=np.float64)


def wrench_torques(chain: Chain, q: Array, joint: int) -> Array:
    """J' of unit forces and couples along a link's axes at its origin, q (M, n): (M, r, 6).

    r: the joints between the base and the link, ``chain.path(joint)``.
    """
    out = np.empty((len(q), joint + 1, 6))
    _fill_wrench_torques(link_table(chain), q, int(chain.in_tree[joint]), out)
    return out[:, chain.path(joint)]


def base_in_link(chain: Chain, q: Array, joint: int) -> Array:
    """The base's axes in a link's, q (M, n): (M, 3, 3)."""
    out = np.empty((len(q), 3, 3))
    _fill_base_in_link(link_table(chain), q, int(chain.in_tree[joint]), out)
    return out


def independent(torques: Array, scale: Array) -> Array:
    """Combinations (k, m) of columns (M, r, k) worth a coefficient, each of 1 N·m RMS over all joints.

    scale: (r,) how many N·m of a joint count as one, so that no combination is large at a weak joint alone.
    """
    flat = (torques / scale[:, None]).reshape(-1, torques.shape[2])
    size = np.linalg.norm(flat, axis=0)
    scaled = flat / np.where(size > 0, size, 1.0)
    values, vectors = np.linalg.eigh(scaled.T @ scaled)
    chosen = values > REDUNDANT**2 * values[-1]
    long = np.sqrt(len(torques) / values[chosen])
    combined: Array = vectors[:, chosen] * long / np.where(size > 0, size, np.inf)[:, None]
    return combined


@kernel
def push_torques(
    links: Array, q: Array, link: int, point: Array, fx: float, fy: float, fz: float, torque: Array
) -> tuple[float, float, float]:
    """Write J' F of a force at a point (3,), both in a link's frame, to torque; returns F in base axes."""
    nx, ny, nz = cross(point[0], point[1], point[2], fx, fy, fz)
    return load_joints(links, q, link, fx, fy, fz, nx, ny, nz, torque)


@kernel
def load_joints(
    links: Array,
    q: Array,
    link: int,
    fx: float,
    fy: float,
    fz: float,
    nx: float,
    ny: float,
    nz: float,
    torque: Array,
) -> tuple[float, float, float]:
    """Write J' of a force and a couple at a link's origin, in its axes, to torque; returns F in base axes."""
    rotation = np.empty(9)
    torque[:] = 0.0
    i = link
    while i >= 0:
        slide, leader = links[i, 0] == 1.0, int(links[i, LEADER])
        torque[leader] += links[i, RATIO] * (fz if slide else nz)
        shift = turn_and_shift(links[i], q[leader], rotation)
        fx, fy, fz = into_parent(rotation, fx, fy, fz)
        nx, ny, nz = into_parent(rotation, nx, ny, nz)
        ox, oy, oz = links[i, 1] + shift * links[i, 6], links[i, 2] + shift * links[i, 9], links[i, 3]
        cx, cy, cz = cross(ox, oy, oz + shift * links[i, 12], fx, fy, fz)
        nx, ny, nz = nx + cx, ny + cy, nz + cz
        i = int(links[i, PARENT])
    return fx, fy, fz


@kernel
def force_in_link(
    links: Array, q: Array, link: int, fx: float, fy: float, fz: float
) -> tuple[float, float, float]:
    """A force in base axes, in a link's."""
    rotation = np.empty(9)
    for i in range(link + 1):
        on_path = link
        while on_path > i:
            on_path = int(links[on_path, PARENT])
        if on_path < i:
            continue
        turn_and_shift(links[i], q[int(links[i, LEADER])], rotation)
        fx, fy, fz = into_link(rotation, fx, fy, fz)
    return fx, fy, fz


@kernel
def turn_and_shift(link: Array, q: float, rotation: Array) -> float:
    """Write the link's rotation in its parent (9,); returns how far it slides along its axis.

    q: position of the joint that moves it.
    """
    slide = link[0] == 1.0
    position = link[RATIO] * q + link[OFFSET]
    angle = 0.0 if slide else position
    link_rotation(link[4:PARENT].reshape((3, 3)), np.cos(angle), np.sin(angle), rotation)
    return position if slide else 0.0


@kernel
def _fill_wrench_torques(links: Array, q: Array, link: int, out: Array) -> None:
    torque, unit = np.empty(out.shape[1]), np.empty(6)
    for t in range(q.shape[0]):
        for component in range(6):
            for k in range(6):
                unit[k] = 1.0 * (k == component)
            load_joints(links, q[t], link, unit[0], unit[1], unit[2], unit[3], unit[4], unit[5], torque)
            for i in range(torque.size):
                out[t, i, component] = torque[i]


@kernel
def _fill_base_in_link(links: Array, q: Array, link: int, out: Array) -> None:
    for t in range(q.shape[0]):
        for axis in range(3):
            ax, ay, az = 1.0 * (axis == 0), 1.0 * (axis == 1), 1.0 * (axis == 2)
            out[t, 0, axis], out[t, 1, axis], out[t, 2, axis] = force_in_link(links, q[t], link, ax, ay, az)
