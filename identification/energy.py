"""The energy of a robot and the power it dissipates, both linear in the standard parameters.

Kinetic and potential energy of link j about its frame's origin, whose velocity is v, angular
velocity omega and position p (Khalil & Dombre 2004, ch. 9; Gautier 1997):

    inertia entries  1/2 omega' E omega
    first moments    v x omega - R' g
    mass             1/2 v . v - g . p
    armature         1/2 dq²

Friction and offset hold no energy; they take up dq (fv dq + fc sgn dq + off).
"""

import numpy as np
from numpy.typing import NDArray

from .chain import Chain
from .parameters import ARMATURE, COULOMB, OFFSET, PER_JOINT, VISCOUS

Array = NDArray[np.float64]


def energy_regressor(chain: Chain, q: Array, dq: Array, columns: NDArray[np.int64]) -> Array:
    """h with energy = h @ theta[columns], shape (N, c), J per unit of the parameter.

    q, dq: (N, n) rad, rad/s (m, m/s for slide joints). Along any motion h differs between equal
    base parameters only by a constant, the zero of the potential energy.
    """
    if (full := chain.followers) is not None:
        found = energy_regressor(
            chain.tree, full.positions(q), full.motions(dq), full.columns_in_tree(columns)
        )
        found[:, full.is_nobodys(columns)] = 0.0
        return found
    samples = len(q)
    h = np.zeros((samples, chain.joints, PER_JOINT))
    base = np.broadcast_to(np.eye(3), (samples, 3, 3)), *(np.zeros((samples, 3)) for _ in range(3))
    links = {-1: base}
    for j in range(chain.joints):
        rotation, position, velocity, spin = links[int(chain.parent[j])]
        offset = np.broadcast_to(chain.translation[j], (samples, 3))
        turn = chain.rotation[j]
        if chain.is_slide[j]:
            offset = offset + q[:, j, None] * turn[:, 2]
            to_parent = np.broadcast_to(turn, (samples, 3, 3))
        else:
            to_parent = turn @ _about_z(q[:, j])
        position = position + _times(rotation, offset)
        velocity = _transposed_times(to_parent, velocity + np.cross(spin, offset))
        spin = _transposed_times(to_parent, spin)
        rotation = rotation @ to_parent
        if chain.is_slide[j]:
            velocity[:, 2] += dq[:, j]
        else:
            spin[:, 2] += dq[:, j]
        links[j] = rotation, position, velocity, spin
        x, y, z = spin.T
        h[:, j, :6] = np.stack([x * x / 2, x * y, x * z, y * y / 2, y * z, z * z / 2], axis=1)
        h[:, j, 6:9] = np.cross(velocity, spin) - chain.gravity @ rotation
        h[:, j, 9] = np.sum(velocity**2, axis=1) / 2 - position @ chain.gravity
        h[:, j, ARMATURE] = dq[:, j] ** 2 / 2
    return h.reshape(samples, -1)[:, columns]


def dissipation_regressor(chain: Chain, dq: Array, columns: NDArray[np.int64]) -> Array:
    """d with power taken up by friction and offset = d @ theta[columns], shape (N, c), W per unit."""
    d = np.zeros((len(dq), chain.links, PER_JOINT))
    own = d[:, : chain.joints]
    own[:, :, VISCOUS], own[:, :, COULOMB], own[:, :, OFFSET] = dq**2, np.abs(dq), dq
    return d.reshape(len(dq), -1)[:, columns]


def fourth_order(x: Array) -> Array:
    """x - (second difference of x) / 12 along axis 0: its trapezoidal sums integrate x to 4th order.

    The Euler-Maclaurin correction of the trapezoidal rule; the two ends stay as they are.
    """
    out = x.copy()
    out[1:-1] -= (x[2:] - 2 * x[1:-1] + x[:-2]) / 12
    return out


def _about_z(angle: Array) -> Array:
    """Rotations about z, (N, 3, 3)."""
    out = np.zeros((len(angle), 3, 3))
    out[:, 0, 0] = out[:, 1, 1] = np.cos(angle)
    out[:, 1, 0] = np.sin(angle)
    out[:, 0, 1] = -out[:, 1, 0]
    out[:, 2, 2] = 1.0
    return out


def _times(matrices: Array, vectors: Array) -> Array:
    return np.einsum("tij,tj->ti", matrices, vectors)


def _transposed_times(matrices: Array, vectors: Array) -> Array:
    return np.einsum("tji,tj->ti", matrices, vectors)
