"""Joints that follow another at a constant ratio: q_f = ratio q_l + offset.

With the positions of all links G q + c, G one for a joint's own link and the ratio for its followers', the
torque of the joints is G' times that of the full tree, still linear in the parameters of all links. Rotors,
friction and springs that a model states at a follower act through the ratio: they are counted to its leader.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .errors import InputError
from .joint_names import joint_label
from .parameters import INERTIAL, PER_JOINT

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

# mjtEq.mjEQ_JOINT
JOINT_EQUALITY = 2
# Numbers of its polynomial in eq_data.
TERMS = 5


@dataclass(frozen=True)
class Follows:
    """A joint's leader, by its index, with q = ratio q_leader + offset; through: joints in between."""

    leader: int
    ratio: float
    offset: float
    through: tuple[int, ...] = ()


@dataclass(frozen=True)
class Followers:
    """The full tree of m links that n joints move, m - n of them followers.

    names: m - n followers. parent, is_slide, rotation, translation: of all links, as a Chain's, every link
    after its parent. leader: (m,) index of the joint that moves each. ratio, offset: (m,), 1 and 0 at a
    joint's own link. place: (m,) where each link's standard parameters are, those of joints before those of
    followers.
    """

    names: tuple[str, ...]
    parent: Indices
    is_slide: NDArray[np.bool_]
    rotation: Array
    translation: Array
    leader: Indices
    ratio: Array
    offset: Array
    place: Indices

    @property
    def joints(self) -> int:
        """Number of joints that follow none, n."""
        return len(self.place) - len(self.names)

    @property
    def in_tree(self) -> Indices:
        """Index of each link, (m,), in the order of the standard parameters."""
        return np.argsort(self.place)

    @property
    def own(self) -> Indices:
        """Index of each joint's own link, (n,)."""
        return self.in_tree[: self.joints]

    @property
    def following(self) -> Indices:
        """Index of each follower's link, (m - n,)."""
        return self.in_tree[self.joints :]

    def positions(self, q: Array) -> Array:
        """Positions (..., m) of all links at those of the joints, (..., n)."""
        return q[..., self.leader] * self.ratio + self.offset

    def motions(self, dq: Array) -> Array:
        """Velocities or accelerations (..., m) of all links at those of the joints, (..., n)."""
        return dq[..., self.leader] * self.ratio

    def folded(self, values: Array) -> Array:
        """G' values: (N, n, ...) of the joints for (N, m, ...) of all links."""
        out = values[:, self.own]
        for link in self.following:
            out[:, self.leader[link]] += self.ratio[link] * values[:, link]
        return out

    def columns_in_tree(self, columns: Indices) -> Indices:
        """Indices of standard parameters in the full tree's order."""
        return PER_JOINT * self.in_tree[columns // PER_JOINT] + columns % PER_JOINT

    def is_nobodys(self, columns: Indices) -> NDArray[np.bool_]:
        """Which columns (c,) are rotors, friction or offsets of followers: their leaders have them."""
        return (columns // PER_JOINT >= self.joints) & (columns % PER_JOINT >= INERTIAL)


def followed(model: Any) -> dict[int, Follows]:
    """The joints of a compiled ``mujoco.MjModel`` that follow one that follows none, by their index.

    They are tied by an active joint equality with a polynomial of first order; where one follows another, the
    ratios are multiplied. A joint that is tied twice, or to itself in the end, is in none.
    """
    direct: dict[int, Follows] = {}
    tied: list[int] = []
    for each in np.flatnonzero((model.eq_type == JOINT_EQUALITY) & model.eq_active0 & (model.eq_obj2id >= 0)):
        joint, leader = int(model.eq_obj1id[each]), int(model.eq_obj2id[each])
        constant, ratio, *higher = (float(term) for term in model.eq_data[each, :TERMS])
        tied.append(joint)
        if ratio != 0 and not any(higher):
            start = model.qpos0[model.jnt_qposadr[joint]] - ratio * model.qpos0[model.jnt_qposadr[leader]]
            direct[joint] = Follows(leader, ratio, float(start) + constant)
    found: dict[int, Follows] = {}
    for joint, own in direct.items():
        while own.leader in direct and own.leader not in (joint, *own.through):
            before, through = direct[own.leader], (*own.through, own.leader)
            offset = own.ratio * before.offset + own.offset
            own = Follows(before.leader, own.ratio * before.ratio, offset, through)
        if own.leader not in tied and all(tied.count(each) == 1 for each in (joint, *own.through)):
            found[joint] = own
    return found


def obstacle(model: Any, joint: int, follows: Follows, moving: set[int]) -> str:
    """Why a joint that follows another cannot be reckoned with, in words; empty where it can.

    moving: the robot's joints, without followers. Torque of a joint may only be of links that come after it
    in the order of the joints.
    """
    for outer in sorted(moving):
        if outer < follows.leader and carries(model, joint, outer):
            names = (joint_label(model, each) for each in (outer, follows.leader))
            return "it carries {}, which comes before {}".format(*names)
    bent = model.jnt_stiffnesspoly[[joint, follows.leader]].any(axis=1)
    if bent[0] or (bent[1] and model.jnt_stiffness[joint]):
        return "its spring and its leader's are no linear one together"
    return ""


def followers_in(
    model: Any, names: Sequence[str], tree: tuple[Indices, NDArray[np.bool_], Array, Array]
) -> Followers | None:
    """The followers in a compiled ``mujoco.MjModel``, None where there are none.

    names: of its joints. tree: their parents, which slide, rotations and translations. Raises InputError for
    a joint that cannot follow another.
    """
    found = followed(model)
    if not found:
        return None
    own = [joint for joint in range(len(names)) if joint not in found]
    for joint, follows in found.items():
        if reason := obstacle(model, joint, follows, set(own)):
            raise InputError(
                "model", names[joint], f"a joint that can follow {names[follows.leader]}", reason
            )
    numbers = {joint: number for number, joint in enumerate([*own, *sorted(found)])}
    each = [found.get(joint, Follows(joint, 1.0, 0.0)) for joint in range(len(names))]
    return Followers(
        tuple(names[joint] for joint in sorted(found)),
        *tree,
        leader=np.array([numbers[follows.leader] for follows in each]),
        ratio=np.array([follows.ratio for follows in each]),
        offset=np.array([follows.offset for follows in each]),
        place=np.array([numbers[joint] for joint in range(len(names))]),
    )


def springs_at_joints(springs: Array, followers: Followers) -> Array:
    """Springs of the joints (n, 4) as springs.py has them, for those of all links (m, 4), linear ones."""
    out = springs[followers.own].copy()
    for link in followers.following:
        stiffness, _, _, rest = springs[link]
        own, ratio = out[followers.leader[link]], followers.ratio[link]
        both = own[0] + ratio**2 * stiffness
        if stiffness != 0:
            own[3] = (own[0] * own[3] + ratio * stiffness * (rest - followers.offset[link])) / both
            own[0] = both
    return out


def parameters_at_joints(table: Array, followers: Followers) -> Array:
    """Standard parameters (m, 14), joints' first, for those of the full tree.

    Rotors and friction of followers are added to their leaders'.
    """
    out = np.empty_like(table)
    out[followers.place] = table
    out[len(followers.own) :, INERTIAL:] = 0.0
    for link in followers.following:
        factor = np.array(
            [followers.ratio[link] ** 2] * 2 + [abs(followers.ratio[link]), followers.ratio[link]]
        )
        out[followers.leader[link], INERTIAL:] += factor * table[link, INERTIAL:]
    return out


def carries(model: Any, joint: int, outer: int) -> bool:
    """Whether a joint moves another's body or lies before it on the same body."""
    body, own = int(model.jnt_bodyid[outer]), int(model.jnt_bodyid[joint])
    if body == own:
        return outer > joint
    while body > 0:
        body = int(model.body_parentid[body])
        if body == own:
            return True
    return False
