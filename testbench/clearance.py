"""Distances between the robot's parts, and to its surroundings, along a motion: MuJoCo's geometry.

A distance's derivative follows from its two witness points: with the unit vector n from one to the
other, d' = n . (J2 - J1), J the points' Jacobians.
"""

import ctypes
from dataclasses import dataclass, field, replace

import llvmlite.binding
import mujoco
import numpy as np
from numba import types
from numpy.typing import NDArray

from identification.chain import Chain
from identification.errors import InputError
from identification.kinematics import cross, kernel
from identification.regressor import in_blocks

from .design_limits import design_limits
from .model_reading.wording import listed
from .robot import Robot

Array = NDArray[np.float64]
# Samples that take a thread much longer than it takes to start.
BLOCK = 512
Indices = NDArray[np.int64]

# Distances are exact up to this much, m, beyond the required one; a pair further apart gets that.
REACH = 0.15
# Random configurations over the whole range, and the quantile of a pair's distances there that counts as how
# far apart it can be without much ado.
CONFIGURATIONS, QUANTILE = 500, 0.9
# m: shapes that are never further apart touch, within the accuracy of meshes.
TOUCH = 2e-4
WITHOUT_VOLUME = {int(mujoco.mjtGeom.mjGEOM_PLANE), int(mujoco.mjtGeom.mjGEOM_HFIELD)}

_library = ctypes.CDLL(mujoco._functions.__file__)
for _name in ("mj_kinematics", "mj_geomDistance"):
    # By name, so that the compiled kernel can be cached on disk.
    llvmlite.binding.add_symbol(_name, ctypes.cast(getattr(_library, _name), ctypes.c_void_p).value)

_kinematics = types.ExternalFunction("mj_kinematics", types.void(types.intp, types.intp))
_geom_distance = types.ExternalFunction(
    "mj_geomDistance",
    types.float64(
        types.intp, types.intp, types.int32, types.int32, types.float64, types.CPointer(types.float64)
    ),
)


@dataclass(frozen=True)
class RobotClearance:
    """Distances of a robot's P geom pairs; implements ``identification.excitation.limits.Clearance``.

    Of a pair that is allowed nearer than ``required``, as much is added to its distance: ``lowered`` (P,) m.
    chain: the robot's. required: m. pairs: P names. geoms: (P, 2) geom indices. links: (P, 2) the link of the
    chain's tree that carries each geom, -1 for the world.
    """

    model: mujoco.MjModel
    chain: Chain
    required: float
    pairs: tuple[str, ...]
    geoms: Indices
    links: Indices
    lowered: Array
    _idle: list[mujoco.MjData] = field(default_factory=list, repr=False, compare=False)

    def distances(self, q: Array) -> Array:
        """Signed distances (N, P) m at the configurations (N, n), capped REACH beyond ``required``."""
        return self._measure(q, np.empty((0, 0, 0)))

    def gradients(self, q: Array) -> tuple[Array, Array]:
        """Signed distances (N, P) m, and their derivatives with respect to q, (N, P, n)."""
        out = np.empty((len(q), len(self.geoms), self.model.njnt))
        distances = self._measure(q, out)
        return distances, self.chain.at_joints(out.swapaxes(1, 2)).swapaxes(1, 2)

    def _measure(self, q: Array, gradients: Array) -> Array:
        q = np.ascontiguousarray(self.chain.link_positions(q), dtype=np.float64)
        tree = self.chain.tree
        distances = np.empty((len(q), len(self.geoms)))
        reach = self.required + REACH

        def measure(start: int, stop: int) -> None:
            part, data = slice(start, stop), self._take_data()
            views = (data.qpos, data.geom_xpos, data.xanchor, data.xaxis)
            addresses = (self.model._address, data._address)
            constants = (self.model.geom_rbound, tree.parent, tree.is_slide, self.geoms, self.links, reach)
            _measure(*addresses, *views, *constants, q[part], distances[part], gradients[part])
            self._idle.append(data)

        in_blocks(measure, len(q), None, BLOCK)
        return distances + self.lowered

    def _take_data(self) -> mujoco.MjData:
        """A work space for one thread; making one costs as much as hundreds of configurations."""
        try:
            return self._idle.pop()
        except IndexError:
            return mujoco.MjData(self.model)


def robot_clearance(robot: Robot, required: float) -> RobotClearance | None:
    """Clearance over the model's collision pairs that can be apart, or None where there is none."""
    return clearance_of(robot, required)[0]


def clearance_of(robot: Robot, required: float) -> tuple[RobotClearance | None, tuple[str, ...]]:
    """Clearance over the collision pairs that can be apart, and sentences on those that cannot be so far.

    A pair that is within TOUCH in all of CONFIGURATIONS, as shapes are that meet where links are joined, is
    left out. One that is seldom twice as far apart as required is asked for half of what it can be, see
    QUANTILE, else next to no motion would be left. Raises InputError as ``_all_pairs``.
    """
    everything = _all_pairs(robot, required)
    if everything is None:
        return None, ()
    limits = design_limits(robot).limits
    if not np.all(np.isfinite(limits.upper - limits.lower)):
        # A slide without a range is refused by name where a motion is designed.
        return everything, ()
    generator = np.random.default_rng(0)
    draw = generator.uniform(limits.lower, limits.upper, (CONFIGURATIONS, robot.joints))
    distances = everything.distances(draw)
    largest, usual = distances.max(axis=0), np.quantile(distances, QUANTILE, axis=0)
    can = largest > TOUCH
    own = np.minimum(required, np.where(usual > 0, usual, largest) / 2)
    notes = []
    if not np.all(can):
        notes.append(f"in touch in every pose, so not kept apart: {listed(_where(everything.pairs, ~can))}")
    near = can & (usual < required)
    if np.any(near):
        names = listed(_where(everything.pairs, near))
        notes.append(f"hardly ever {required:g} m apart, so kept half as far apart as they can be: {names}")
    if not np.any(can):
        return None, tuple(notes)
    kept = replace(
        everything,
        pairs=_where(everything.pairs, can),
        geoms=everything.geoms[can],
        links=everything.links[can],
        lowered=(required - own)[can],
    )
    return kept, tuple(notes)


def _where(names: tuple[str, ...], which: NDArray[np.bool_]) -> tuple[str, ...]:
    return tuple(name for name, one in zip(names, which, strict=True) if one)


def _all_pairs(robot: Robot, required: float) -> RobotClearance | None:
    """Clearance over all of the model's collision pairs, or None where it has none.

    The pairs are those of <contact><pair>, and the geoms whose contype and conaffinity let them
    collide on links that are not neighbours (the base is the neighbour of the first link).
    required: m. Raises InputError when it is negative.
    """
    if not required >= 0:
        raise InputError(robot.path, "clearance", "a distance of at least 0 m", required)
    model = robot.model
    carriers, tree = _carriers(model), robot.chain.tree
    found = {(int(a), int(b)) for a, b in zip(model.pair_geom1, model.pair_geom2, strict=True)}
    for a in range(model.ngeom):
        for b in range(a + 1, model.ngeom):
            if _collide(model, a, b) and not _neighbours(tree, carriers[a], carriers[b]):
                found.add((a, b))
    # Geoms that do not move against each other keep their distance, whatever the motion.
    ordered = sorted(pair for pair in found if carriers[pair[0]] != carriers[pair[1]])
    if not ordered:
        return None
    geoms = np.array(ordered, dtype=np.int64)
    return RobotClearance(
        model=model,
        chain=robot.chain,
        required=float(required),
        pairs=tuple(f"{_geom_name(model, a)} and {_geom_name(model, b)}" for a, b in ordered),
        geoms=geoms,
        links=carriers[geoms],
        lowered=np.zeros(len(geoms)),
    )


def _carriers(model: mujoco.MjModel) -> Indices:
    """The joint whose link carries each geom (ngeom,), -1 for the world."""
    joint = np.full(model.nbody, -1, dtype=np.int64)
    for body in range(1, model.nbody):
        count = int(model.body_jntnum[body])
        own = int(model.body_jntadr[body]) + count - 1
        joint[body] = own if count else joint[model.body_parentid[body]]
    return joint[model.geom_bodyid]


def _neighbours(chain: Chain, link: int, other: int) -> bool:
    """Whether two links (-1: the base) are one, or one carries the other."""
    first, second = sorted((link, other))
    return first == second or bool(chain.parent[second] == first)


def _collide(model: mujoco.MjModel, a: int, b: int) -> bool:
    """Whether MuJoCo's filter lets two geoms collide (and can: two planes cannot)."""
    if {int(model.geom_type[a]), int(model.geom_type[b])} <= WITHOUT_VOLUME:
        return False
    contype, conaffinity = model.geom_contype, model.geom_conaffinity
    return bool(contype[a] & conaffinity[b] or contype[b] & conaffinity[a])


def _geom_name(model: mujoco.MjModel, geom: int) -> str:
    """A geom's own name, or that of its body."""
    return model.geom(geom).name or model.body(model.geom_bodyid[geom]).name


@kernel
def _measure(
    model: int,
    data: int,
    qpos: Array,
    centres: Array,
    anchors: Array,
    axes: Array,
    radii: Array,
    parent: Indices,
    is_slide: NDArray[np.bool_],
    geoms: Indices,
    links: Indices,
    reach: float,
    q: Array,
    distances: Array,
    gradients: Array,
) -> None:
    witness = np.zeros(6)
    wanted = gradients.shape[0] > 0
    for t in range(q.shape[0]):
        for j in range(q.shape[1]):
            qpos[j] = q[t, j]
        _kinematics(model, data)
        for p in range(geoms.shape[0]):
            a, b = geoms[p, 0], geoms[p, 1]
            dx, dy, dz = (
                centres[b, 0] - centres[a, 0],
                centres[b, 1] - centres[a, 1],
                centres[b, 2] - centres[a, 2],
            )
            span = reach + radii[a] + radii[b]
            distance = reach
            # A bounding radius of 0 means an unbounded geom, such as a plane.
            if radii[a] == 0.0 or radii[b] == 0.0 or dx * dx + dy * dy + dz * dz < span * span:
                distance = _geom_distance(model, data, np.int32(a), np.int32(b), reach, witness.ctypes)
            distances[t, p] = distance
            if not wanted:
                continue
            for j in range(q.shape[1]):
                gradients[t, p, j] = 0.0
            # Where two geoms just touch, the direction between the witness points is undefined.
            if distance >= reach or distance == 0.0:
                continue
            for side in range(2):
                factor = (2.0 * side - 1.0) / distance
                nx = factor * (witness[3] - witness[0])
                ny = factor * (witness[4] - witness[1])
                nz = factor * (witness[5] - witness[2])
                j = links[p, side]
                while j >= 0:
                    vx, vy, vz = axes[j, 0], axes[j, 1], axes[j, 2]
                    if not is_slide[j]:
                        rx = witness[3 * side] - anchors[j, 0]
                        ry = witness[3 * side + 1] - anchors[j, 1]
                        rz = witness[3 * side + 2] - anchors[j, 2]
                        vx, vy, vz = cross(vx, vy, vz, rx, ry, rz)
                    gradients[t, p, j] += nx * vx + ny * vy + nz * vz
                    j = parent[j]
