"""The kinematics of a robot on a fixed base as plain arrays, read from a compiled MJCF once.

Joints form a tree: an arm without branches is the common case. Each joint knows the one before it on its
branch, its parent (the array lambda of Featherstone, "Rigid Body Dynamics Algorithms", 2008, ch. 4).

Link frames: the origin lies on the joint's anchor and z along the joint's axis. Where the MJCF
body frame already does so (as in a modified Denavit-Hartenberg model) the link frame is the body
frame. Bodies without a joint are welded to the link that carries them.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .errors import InputError
from .followers import Followers, followers_in, parameters_at_joints, springs_at_joints
from .joint_names import joint_label
from .kinematics import moving
from .parameters import ARMATURE, COULOMB, INERTIAL, PER_JOINT, VISCOUS, inertial_parameters

Array = NDArray[np.float64]
# parent, is_slide, rotation, translation, gravity, springs.
ChainArrays = tuple[NDArray[np.int64], NDArray[np.bool_], Array, Array, Array, Array]

FREE, SLIDE, HINGE = 0, 2, 3
# mjtDisableBit.mjDSBL_SPRING and mjDSBL_GRAVITY
SPRINGS_DISABLED, GRAVITY_DISABLED = 1 << 5, 1 << 7
JOINT_TYPES = {0: "free", 1: "ball", 2: "slide", 3: "hinge"}


@dataclass(frozen=True)
class Chain:
    """A tree of n hinge and slide joints.

    joint_names: n names, every joint after its parent.
    parent: (n,) index of the joint before on the same branch, -1 for the base.
    is_slide: (n,) bool.
    rotation: (n, 3, 3), link frame in its parent's at q = 0; columns are the link's axes.
    translation: (n, 3) m, link origin in its parent's frame at q = 0.
    gravity: (3,) m/s², in the base (world) frame.
    springs: (n, 4), see springs.py.
    followers: the full tree, where links follow joints of this one; else None. A joint's parent is then the
    one that moves the link before it, and its rotation and translation are in that link's frame.
    """

    joint_names: tuple[str, ...]
    parent: NDArray[np.int64]
    is_slide: NDArray[np.bool_]
    rotation: Array
    translation: Array
    gravity: Array
    springs: Array
    followers: Followers | None = None

    def __post_init__(self) -> None:
        """Raises ValueError unless every joint comes after its parent."""
        if np.any(self.parent < -1) or np.any(self.parent >= np.arange(self.joints)):
            raise ValueError(f"parent: every joint after its parent, not {np.asarray(self.parent).tolist()}")

    @property
    def joints(self) -> int:
        """Number of joints, n."""
        return len(self.joint_names)

    @property
    def links(self) -> int:
        """Number of links with standard parameters: the joints' own, then those of followers."""
        return self.joints if self.followers is None else len(self.followers.place)

    @property
    def link_names(self) -> tuple[str, ...]:
        """Names of the joints whose links these are, in the order of the standard parameters."""
        return self.joint_names if self.followers is None else self.joint_names + self.followers.names

    @property
    def link_slides(self) -> NDArray[np.bool_]:
        """Which of these slide, (links,)."""
        if self.followers is None:
            return self.is_slide
        return self.followers.is_slide[self.followers.in_tree]

    @property
    def arrays(self) -> ChainArrays:
        """The fields as compiled code takes them. Raises InputError where joints follow others."""
        if self.followers is not None:
            expected = "a robot none of whose joints follows another, for this method"
            raise InputError("model", "joints", expected, ", ".join(self.followers.names))
        return self.parent, self.is_slide, self.rotation, self.translation, self.gravity, self.springs

    @property
    def tree(self) -> "Chain":
        """All links, each with a joint of its own, in the model's order; springs at the joints' own."""
        full = self.followers
        if full is None:
            return self
        names, springs = np.array(self.link_names)[full.place], np.zeros((self.links, self.springs.shape[1]))
        springs[full.own] = self.springs
        shape = (full.parent, full.is_slide, full.rotation, full.translation)
        return Chain(tuple(map(str, names)), *shape, self.gravity, springs)

    @property
    def in_tree(self) -> NDArray[np.int64]:
        """Index in ``tree`` of each link, (links,), in the order of the standard parameters."""
        return np.arange(self.joints) if self.followers is None else self.followers.in_tree

    @property
    def last(self) -> int:
        """Which link, in that order, comes last in the model, and carries a tool."""
        return self.joints - 1 if self.followers is None else int(self.followers.place[-1])

    @property
    def leaders(self) -> NDArray[np.int64]:
        """Index of the joint that moves each link of ``tree``, (links,)."""
        return np.arange(self.joints) if self.followers is None else self.followers.leader

    def link_positions(self, q: Array) -> Array:
        """Positions (..., links) of all links of ``tree`` at those of the joints, (..., n)."""
        return q if self.followers is None else self.followers.positions(q)

    def link_motions(self, dq: Array) -> Array:
        """Velocities or accelerations (..., links) likewise."""
        return dq if self.followers is None else self.followers.motions(dq)

    def at_joints(self, values: Array) -> Array:
        """(N, n, ...) of the joints for torques or derivatives (N, links, ...) of ``tree``."""
        return values if self.followers is None else self.followers.folded(values)

    @property
    def moves(self) -> NDArray[np.bool_]:
        """Which joints i move which links j, [j, i] of (n, n)."""
        full = self.followers
        if full is None:
            return np.asarray(moving(self.parent), dtype=bool)
        by_link = np.asarray(moving(full.parent), dtype=bool)[full.own]
        return np.stack(
            [by_link[:, full.leader == joint].any(axis=1) for joint in range(self.joints)], axis=1
        )

    def loading(self, joint: int) -> slice:
        """The standard parameters that may load a joint: from its own link's to the last link's it moves."""
        moved = moving(self.tree.parent)[:, self.leaders == joint].any(axis=1)[self.in_tree]
        return slice(PER_JOINT * joint, PER_JOINT * (int(np.flatnonzero(moved)[-1]) + 1))

    def path(self, joint: int) -> list[int]:
        """The joints that move a joint's link, base to link; the last is the joint itself."""
        return [int(each) for each in np.flatnonzero(self.moves[joint])]

    def children(self, joint: int) -> list[int]:
        """The joints that sit on a joint's link."""
        return [int(each) for each in np.flatnonzero(self.parent == joint)]

    def without_springs(self) -> "Chain":
        """The same bodies and gravity alone."""
        return replace(self, springs=np.zeros_like(self.springs))


@dataclass(frozen=True)
class _Placement:
    """Where a body hangs: its link (-1: world), and its pose in that link's frame at q = 0."""

    link: int
    rotation: Array
    position: Array


def chain_from_model(model: Any) -> tuple[Chain, Array]:
    """The joints' tree of a compiled ``mujoco.MjModel``, and its standard parameters, shape (14 links,).

    The parameters are those of the model itself: inertias, armature, damping and frictionloss;
    the offset is zero. Joints that an equality ties to another follow it. Raises InputError when the model is
    not a robot of hinge and slide joints on a fixed base, or drives itself.
    """
    _require_fixed_base(model)
    n = model.njnt
    rotations, translations, parents = np.empty((n, 3, 3)), np.empty((n, 3)), np.empty(n, np.int64)
    parameters = np.zeros((n, PER_JOINT))
    placements = {0: _Placement(-1, np.eye(3), np.zeros(3))}
    for body in range(1, model.nbody):
        parent = placements[int(model.body_parentid[body])]
        rotation = parent.rotation @ _matrix(model.body_quat[body])
        position = parent.position + parent.rotation @ model.body_pos[body]
        link = parent.link
        start, count = int(model.body_jntadr[body]), int(model.body_jntnum[body])
        for joint in range(start, start + count):
            frame = rotation @ frame_with_z(model.jnt_axis[joint])
            anchor = position + rotation @ model.jnt_pos[joint]
            rotations[joint], translations[joint] = _pose_at_zero(model, joint, frame, anchor)
            parents[joint] = link
            # From here on the body is described in this joint's link frame.
            position, rotation = frame.T @ (position - anchor), frame.T @ rotation
            link = joint
        placements[body] = _Placement(link, rotation, position)
        if link >= 0:
            parameters[link, :INERTIAL] += _body_parameters(model, body, rotation, position)
    parameters[:, ARMATURE] = model.dof_armature
    parameters[:, VISCOUS] = np.asarray(model.dof_damping).reshape(n, -1)[:, 0]
    parameters[:, COULOMB] = model.dof_frictionloss
    names = tuple(joint_label(model, j) for j in range(n))
    _require_distinct(names)
    _require_none_negative(parameters, names)
    chain = Chain(
        joint_names=names,
        parent=parents,
        is_slide=np.asarray(model.jnt_type) == SLIDE,
        rotation=rotations,
        translation=translations,
        gravity=gravity(model),
        springs=_springs(model),
    )
    followers = followers_in(model, names, (parents, chain.is_slide, rotations, translations))
    if followers is None:
        return chain, parameters.ravel()
    return _led(chain, followers), parameters_at_joints(parameters, followers).ravel()


def _led(tree: Chain, followers: Followers) -> Chain:
    """The chain of the joints that follow none."""
    own, parents = followers.own, []
    for joint, link in enumerate(own):
        before = int(tree.parent[link])
        # A joint may sit on one that follows it.
        while before >= 0 and followers.leader[before] == joint:
            before = int(tree.parent[before])
        parents.append(int(followers.leader[before]) if before >= 0 else -1)
    return Chain(
        joint_names=tuple(tree.joint_names[joint] for joint in own),
        parent=np.array(parents, dtype=np.int64),
        is_slide=tree.is_slide[own],
        rotation=tree.rotation[own],
        translation=tree.translation[own],
        gravity=tree.gravity,
        springs=springs_at_joints(tree.springs, followers),
        followers=followers,
    )


def gravity(model: Any) -> Array:
    """Gravity (3,) m/s² of a compiled ``mujoco.MjModel``, in the world frame; zero where disabled."""
    return np.zeros(3) if model.opt.disableflags & GRAVITY_DISABLED else np.array(model.opt.gravity)


def _springs(model: Any) -> Array:
    """The joints' springs (n, 4) as springs.py has them; zero where disabled."""
    springs = np.column_stack([model.jnt_stiffness, model.jnt_stiffnesspoly, model.qpos_spring])
    return np.zeros_like(springs) if model.opt.disableflags & SPRINGS_DISABLED else springs


def _require_fixed_base(model: Any) -> None:
    """Raise InputError unless there are joints, all of them hinges and slides."""
    if model.njnt == 0:
        raise InputError("model", "joint", "at least one hinge or slide joint", "none")
    for joint in range(model.njnt):
        kind = int(model.jnt_type[joint])
        if kind in (HINGE, SLIDE):
            continue
        got = JOINT_TYPES[kind]
        if kind == FREE and _carries_joints(model, int(model.jnt_bodyid[joint])):
            got += ", a moving base; hold the trunk: clamp the robot, and take this joint out of the model"
        name = model.joint(joint).name or f"joint {joint}"
        expected = "a hinge or slide joint of a robot on a fixed base"
        raise InputError("model", name, expected, got, ("hinge", "slide"))


def _carries_joints(model: Any, trunk: int) -> bool:
    """Whether other bodies with joints hang on a body that hangs on the world."""
    carried = (np.asarray(model.body_rootid) == trunk) & (np.arange(model.nbody) != trunk)
    return bool(np.any(np.asarray(model.body_jntnum)[carried]))


def _require_distinct(names: Sequence[str]) -> None:
    """Raise InputError where an unnamed joint would be called as another one is."""
    for name in names:
        if names.count(name) > 1:
            expected = "distinct names; a joint without one is called joint_N by its number"
            raise InputError("model", "joint name", expected, f"{name} twice")


def _require_none_negative(parameters: Array, names: Sequence[str]) -> None:
    """Raise InputError for rotors and friction (n, 14) that would drive the joints; MuJoCo loads them."""
    for field, place in (("armature", ARMATURE), ("damping", VISCOUS), ("frictionloss", COULOMB)):
        for name, value in zip(names, parameters[:, place], strict=True):
            if value < 0:
                raise InputError("model", f"{field} of {name}", "zero or more", f"{value:g}")


def _body_parameters(model: Any, body: int, rotation: Array, position: Array) -> Array:
    """Ten inertial parameters (10,) of a body placed at ``rotation``, ``position`` in its link frame."""
    center = position + rotation @ model.body_ipos[body]
    axes = rotation @ _matrix(model.body_iquat[body])
    inertia = axes @ np.diag(model.body_inertia[body]) @ axes.T
    return inertial_parameters(float(model.body_mass[body]), center, inertia)


def _pose_at_zero(model: Any, joint: int, frame: Array, anchor: Array) -> tuple[Array, Array]:
    """The link frame at q = 0, from the one drawn in the MJCF, which stands at q = ``ref``."""
    reference = float(model.qpos0[joint])
    if model.jnt_type[joint] == SLIDE:
        return frame, anchor - reference * frame[:, 2]
    c, s = np.cos(reference), np.sin(reference)
    return frame @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]]), anchor


def _matrix(quaternion: Array) -> Array:
    """Rotation matrix (3, 3) of a quaternion (w, x, y, z)."""
    w, x, y, z = quaternion / np.linalg.norm(quaternion)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def frame_with_z(axis: Array) -> Array:
    """A rotation (3, 3) whose third column is ``axis``; the smallest turn that does it."""
    z = axis / np.linalg.norm(axis)
    if z[2] > 1 - 1e-14:
        return np.eye(3)
    if z[2] < -1 + 1e-14:
        return np.diag([1.0, -1.0, -1.0])
    # Rodrigues' formula about e_z x axis.
    v = np.array([-z[1], z[0], 0.0])
    cross = np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])
    return np.eye(3) + cross + cross @ cross / (1 + z[2])
