"""Rigid links in a serial chain, shared by the plants: inverse dynamics, mass matrix, MJCF.

Body frames are parallel to the world's at zero, so that a link is its place, axis, mass, centre and inertia.
Luh, Walker & Paul, "On-line computational scheme for mechanical manipulators", 1980.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]

GRAVITY = 9.81  # m/s²


@dataclass(frozen=True)
class Links:
    """n moving links. place: (n, 3) m, of each joint in its parent. axis: (n, 3). slide: (n,) bool.

    mass: (n,) kg. centre: (n, 3) m. inertia: (n, 3, 3) kg·m² about the centre. armature: (n,) kg·m² (kg).
    gravity: (3,) m/s². lower, upper: (n,) rad (m). speed, torque: (n,) limits. viscous, coulomb: (n,).
    """

    place: Array
    axis: Array
    slide: NDArray[np.bool_]
    mass: Array
    centre: Array
    inertia: Array
    armature: Array
    gravity: Array
    lower: Array
    upper: Array
    speed: Array
    torque: Array
    viscous: Array
    coulomb: Array

    @property
    def joints(self) -> int:
        """Number of joints, n."""
        return len(self.mass)

    @property
    def names(self) -> tuple[str, ...]:
        """Joint names."""
        return tuple(f"joint_{index}" for index in range(1, self.joints + 1))

    @property
    def body(self) -> tuple[NDArray[Any], ...]:
        """Arrays that the compiled dynamics functions take as arguments."""
        return (
            self.place,
            self.axis,
            self.slide,
            self.mass,
            self.centre,
            self.inertia,
            self.armature,
            self.gravity,
        )

    def carrying(self, mass: float, centre: Array) -> "Links":
        """The same with a point mass, kg, on the last link at ``centre`` (3,), m."""
        total = self.mass[-1] + mass
        joint = (self.mass[-1] * self.centre[-1] + mass * centre) / total
        inertia = self.inertia[-1] + _steiner(self.mass[-1], self.centre[-1] - joint)
        inertia = inertia + _steiner(mass, centre - joint)
        changed = {"mass": total, "centre": joint, "inertia": inertia}
        own = {name: getattr(self, name).copy() for name in changed}
        for name, value in changed.items():
            own[name][-1] = value
        return replace(self, **own)

    def tilted(self, roll: float, pitch: float) -> "Links":
        """The same on a base turned by roll about x, then pitch about y, rad."""
        cr, sr, cp, sp = np.cos(roll), np.sin(roll), np.cos(pitch), np.sin(pitch)
        about_x = np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
        about_y = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
        return replace(self, gravity=(about_y @ about_x).T @ self.gravity)

    def from_cad(self, rng: np.random.Generator, spread: float = 1.0) -> "Links":
        """The nominal model's links: off as CAD and data sheets are."""

        def off(shape: tuple[int, ...], deviation: float) -> Array:
            return np.exp(spread * deviation * rng.standard_normal(shape))

        n = self.joints
        size = np.sqrt(np.trace(self.inertia, axis1=1, axis2=2) / self.mass)
        return replace(
            self,
            mass=self.mass * off((n,), 0.05),
            centre=self.centre + spread * 0.05 * size[:, None] * rng.standard_normal((n, 3)),
            inertia=self.inertia * off((n, 1, 1), 0.12),
            armature=self.armature * off((n,), 0.1),
            viscous=self.viscous * off((n,), 0.3),
            coulomb=self.coulomb * off((n,), 0.25),
        )

    def mjcf(self, name: str) -> str:
        """The model as MJCF, one body a joint."""
        lines, indent = [], "    "
        for j, joint in enumerate(self.names):
            i = self.inertia[j]
            full = _text([i[0, 0], i[1, 1], i[2, 2], i[0, 1], i[0, 2], i[1, 2]])
            kind = "slide" if self.slide[j] else "hinge"
            lines += [
                f'{indent}<body name="link_{j + 1}" pos="{_text(self.place[j])}">',
                f'{indent}  <inertial pos="{_text(self.centre[j])}" mass="{_text([self.mass[j]])}" '
                f'fullinertia="{full}"/>',
                f'{indent}  <joint name="{joint}" type="{kind}" axis="{_text(self.axis[j])}" '
                f'range="{_text([self.lower[j], self.upper[j]])}" armature="{_text([self.armature[j]])}" '
                f'damping="{_text([self.viscous[j]])}" frictionloss="{_text([self.coulomb[j]])}" '
                f'actuatorfrcrange="{_text([-self.torque[j], self.torque[j]])}"/>',
            ]
            indent += "  "
        for _ in range(self.joints):
            indent = indent[:-2]
            lines.append(f"{indent}</body>")
        return "\n".join(
            [
                f'<mujoco model="{name}">',
                '  <compiler angle="radian"/>',
                f'  <option gravity="0 0 {-GRAVITY}"/>',
                f'  <custom><numeric name="velocity_limit" data="{_text(self.speed)}"/></custom>',
                "  <worldbody>",
                *lines,
                "  </worldbody>",
                "</mujoco>",
                "",
            ]
        )


def upright(axes: str, lengths: Array, mass: Array, armature: Array, rng: np.random.Generator) -> Links:
    """An arm that stands upright at zero; axes: a letter of x, y, z a joint.

    lengths: (n,) m above each joint.

    Links are rods of some thickness whose centres lie a little to the side. Limits and friction are zero.
    """
    n = len(axes)
    units = {"x": [1.0, 0, 0], "y": [0, 1.0, 0], "z": [0, 0, 1.0]}
    place = np.zeros((n, 3))
    place[1:, 2] = lengths[:-1]
    place[1:, 1] = rng.uniform(-0.03, 0.03, n - 1)
    place[1:, 0] = rng.uniform(-0.02, 0.05, n - 1)
    centre = np.column_stack(
        [
            rng.uniform(-0.1, 0.15, n) * lengths,
            rng.uniform(-0.1, 0.1, n) * lengths,
            rng.uniform(0.35, 0.6, n) * lengths,
        ]
    )
    thick, long = 0.25 * lengths + 0.03, lengths + 0.05
    inertia = np.zeros((n, 3, 3))
    inertia[:, 0, 0] = inertia[:, 1, 1] = mass * (long**2 / 12 + thick**2 / 16)
    inertia[:, 2, 2] = mass * thick**2 / 8
    nothing = np.zeros(n)
    return Links(
        place=place,
        axis=np.array([units[letter] for letter in axes]),
        slide=np.zeros(n, dtype=bool),
        mass=mass,
        centre=centre,
        inertia=inertia,
        armature=armature,
        gravity=np.array([0.0, 0.0, -GRAVITY]),
        lower=nothing,
        upper=nothing,
        speed=nothing,
        torque=nothing,
        viscous=nothing,
        coulomb=nothing,
    )


def _steiner(mass: float, offset: Array) -> Array:
    return mass * (offset @ offset * np.eye(3) - np.outer(offset, offset))


def _text(values: object) -> str:
    return " ".join(f"{value:.9g}" for value in np.atleast_1d(np.asarray(values, dtype=float)))


@njit(cache=True)
def _cross(a: Array, b: Array, out: Array) -> None:
    x = a[1] * b[2] - a[2] * b[1]
    y = a[2] * b[0] - a[0] * b[2]
    out[2] = a[0] * b[1] - a[1] * b[0]
    out[0], out[1] = x, y


@njit(cache=True)
def inverse(
    place: Array,
    axis: Array,
    slide: Array,
    mass: Array,
    centre: Array,
    inertia: Array,
    armature: Array,
    gravity: Array,
    q: Array,
    dq: Array,
    ddq: Array,
    tau: Array,
    work: Array,
) -> None:
    """Torque (n,) into ``tau`` for a motion (n,); work: (8, n + 1, 3) scratch."""
    n = q.size
    turn = np.empty((n, 3, 3))
    rate, spin, lift, force, couple, at = work[0], work[1], work[2], work[3], work[4], work[5]
    t, u, w = work[6, 0], work[6, 1], work[7, 0]
    for i in range(3):
        rate[0, i] = spin[0, i] = 0.0
        lift[0, i] = -gravity[i]
    for j in range(n):
        a = axis[j]
        c, s = np.cos(q[j]), np.sin(q[j])
        if slide[j]:
            c, s = 1.0, 0.0
        for row in range(3):
            for column in range(3):
                turn[j, row, column] = (1.0 - c) * a[row] * a[column] + (c if row == column else 0.0)
        turn[j, 0, 1] -= s * a[2]
        turn[j, 1, 0] += s * a[2]
        turn[j, 0, 2] += s * a[1]
        turn[j, 2, 0] -= s * a[1]
        turn[j, 1, 2] -= s * a[0]
        turn[j, 2, 1] += s * a[0]
        for i in range(3):
            at[j, i] = place[j, i] + (a[i] * q[j] if slide[j] else 0.0)
        # The joint's acceleration in the parent's frame.
        _cross(rate[j], at[j], t)
        _cross(rate[j], t, u)
        _cross(spin[j], at[j], t)
        for i in range(3):
            w[i] = lift[j, i] + t[i] + u[i]
        for i in range(3):
            x, y, z = 0.0, 0.0, 0.0
            for k in range(3):
                x += turn[j, k, i] * rate[j, k]
                y += turn[j, k, i] * spin[j, k]
                z += turn[j, k, i] * w[k]
            rate[j + 1, i], spin[j + 1, i], lift[j + 1, i] = x, y, z
        _cross(rate[j + 1], a, t)
        for i in range(3):
            if slide[j]:
                lift[j + 1, i] += a[i] * ddq[j] + 2.0 * dq[j] * t[i]
            else:
                spin[j + 1, i] += a[i] * ddq[j] + dq[j] * t[i]
        if not slide[j]:
            for i in range(3):
                rate[j + 1, i] += a[i] * dq[j]
        _cross(rate[j + 1], centre[j], t)
        _cross(rate[j + 1], t, u)
        _cross(spin[j + 1], centre[j], t)
        for i in range(3):
            force[j, i] = mass[j] * (lift[j + 1, i] + t[i] + u[i])
        for i in range(3):
            x, y = 0.0, 0.0
            for k in range(3):
                x += inertia[j, i, k] * spin[j + 1, k]
                y += inertia[j, i, k] * rate[j + 1, k]
            couple[j, i], u[i] = x, y
        _cross(rate[j + 1], u, t)
        _cross(centre[j], force[j], w)
        for i in range(3):
            couple[j, i] += t[i] + w[i]
    for j in range(n - 1, -1, -1):
        a = axis[j]
        tau[j] = armature[j] * ddq[j]
        for i in range(3):
            tau[j] += a[i] * (force[j, i] if slide[j] else couple[j, i])
        if j == 0:
            break
        for i in range(3):
            x, y = 0.0, 0.0
            for k in range(3):
                x += turn[j, i, k] * force[j, k]
                y += turn[j, i, k] * couple[j, k]
            t[i], u[i] = x, y
        _cross(at[j], t, w)
        for i in range(3):
            force[j - 1, i] += t[i]
            couple[j - 1, i] += u[i] + w[i]


@njit(cache=True)
def dynamics(
    place: Array,
    axis: Array,
    slide: Array,
    mass: Array,
    centre: Array,
    inertia: Array,
    armature: Array,
    gravity: Array,
    q: Array,
    dq: Array,
    matrix: Array,
    bias: Array,
    work: Array,
) -> None:
    """Mass matrix (n, n), lower triangle right, and bias (n,) of Coriolis and gravity at a state."""
    n = q.size
    still, unit, column, nothing = np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(3)
    inverse(place, axis, slide, mass, centre, inertia, armature, gravity, q, dq, still, bias, work)
    rest = np.zeros(n)
    for j in range(n):
        unit[j] = 1.0
        inverse(place, axis, slide, mass, centre, inertia, armature, nothing, q, rest, unit, column, work)
        unit[j] = 0.0
        for i in range(n):
            matrix[i, j] = column[i]


@njit(cache=True)
def solve(matrix: Array, right: Array, out: Array) -> None:
    """out = matrix^-1 right, (n,), by Cholesky in place of the lower triangle of ``matrix``."""
    n = right.size
    for j in range(n):
        for k in range(j):
            matrix[j, j] -= matrix[j, k] ** 2
        matrix[j, j] = np.sqrt(matrix[j, j])
        for i in range(j + 1, n):
            for k in range(j):
                matrix[i, j] -= matrix[i, k] * matrix[j, k]
            matrix[i, j] /= matrix[j, j]
    for i in range(n):
        out[i] = right[i]
        for k in range(i):
            out[i] -= matrix[i, k] * out[k]
        out[i] /= matrix[i, i]
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            out[i] -= matrix[k, i] * out[k]
        out[i] /= matrix[i, i]


@njit(cache=True)
def inverse_along(
    place: Array,
    axis: Array,
    slide: Array,
    mass: Array,
    centre: Array,
    inertia: Array,
    armature: Array,
    gravity: Array,
    q: Array,
    dq: Array,
    ddq: Array,
) -> Array:
    """Torque (N, n) along a motion (N, n)."""
    out, work = np.empty(q.shape), np.zeros((8, q.shape[1] + 2, 3))
    for k in range(q.shape[0]):
        inverse(
            place, axis, slide, mass, centre, inertia, armature, gravity, q[k], dq[k], ddq[k], out[k], work
        )
    return out
