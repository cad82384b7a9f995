"""Robots with branches: random trees, a dual arm on a post, four legs on a held trunk."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

MOST_BRANCHES = 4


@dataclass(frozen=True)
class Tree:
    """A random robot: its joints' parents, and its model as MJCF."""

    parents: tuple[int, ...]
    xml: str


@st.composite
def trees(draw: Any) -> Tree:
    """Trees of 3 to 12 hinges and slides in one to four branches, some joints two to a body."""
    joints = draw(st.integers(3, 12))
    slides = draw(st.lists(st.booleans(), min_size=joints, max_size=joints))
    branches = draw(st.sets(st.integers(1, joints - 1), max_size=MOST_BRANCHES - 1))
    parents = [-1]
    for joint in range(1, joints):
        before = _path(parents, joint - 1)
        parents.append(draw(st.sampled_from(before[:-1])) if joint in branches else joint - 1)
    children = [parents.count(joint) for joint in range(joints)]
    single = [j for j in range(1, joints) if parents[j] == j - 1 and children[j - 1] == 1]
    shared = draw(st.sets(st.sampled_from(single), max_size=1)) if single else set()
    return Tree(tuple(parents), tree_xml(parents, slides, shared, draw(st.integers(0, 999))))


def tree_xml(
    parents: Sequence[int], slides: Sequence[bool], shared: Collection[int] = (), seed: int = 0
) -> str:
    """A tree with random frames, inertias, armature, damping and friction loss.

    shared: joints that share a body with their parent, which is on the body before.
    """
    rng = np.random.default_rng(seed)

    def joint(index: int) -> str:
        axis, place = _text(rng.normal(size=3)), _text(0.2 * rng.normal(size=3))
        armature, damping, loss = rng.uniform(0.01, 1, 3)
        kind = "slide" if slides[index] else "hinge"
        own = (
            f'<joint name="joint_{index}" type="{kind}" axis="{axis}" pos="{place}" armature="{armature}" '
            f'damping="{damping}" frictionloss="{loss}"/>'
        )
        return own + (joint(index + 1) if index + 1 in shared else "")

    def body(index: int) -> str:
        quaternion, place = _text(Rotation.random(rng=rng).as_quat()), _text(0.5 * rng.normal(size=3))
        last = index + 1 if index + 1 in shared else index
        inside = "".join(
            body(other) for other, parent in enumerate(parents) if parent == last and other not in shared
        )
        own = f'name="link_{index}" pos="{place}" quat="{quaternion}"'
        return f"<body {own}>{joint(index)}{_inertial(rng)}{inside}</body>"

    roots = "".join(body(index) for index, parent in enumerate(parents) if parent < 0)
    # Pinocchio reads one body of the world alone.
    return (
        f'<mujoco><compiler angle="radian"/><worldbody><body name="post">{roots}</body></worldbody></mujoco>'
    )


def _path(parents: Sequence[int], joint: int) -> list[int]:
    """From the base, -1, to a joint."""
    return [-1] if joint < 0 else [*_path(parents, parents[joint]), joint]


def _inertial(rng: np.random.Generator) -> str:
    """The inertial of a cloud of points."""
    masses, points = rng.uniform(0.1, 1, 5), 0.2 * rng.normal(size=(5, 3))
    centre = masses @ points / masses.sum()
    arms = points - centre
    tensor = sum(
        m * (arm @ arm * np.eye(3) - np.outer(arm, arm)) for m, arm in zip(masses, arms, strict=True)
    )
    full = _text(tensor[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]])
    return f'<inertial pos="{_text(centre)}" mass="{masses.sum()}" fullinertia="{full}"/>'


def _text(values: np.ndarray) -> str:
    return " ".join(repr(float(value)) for value in values)


def _limb(side: str, place: str, mirror: int) -> str:
    """Three joints: a hip or shoulder about x, then two about y."""
    rotor = 'armature=".05" damping="1" frictionloss="1.5" actuatorfrcrange="-60 60"'
    return f"""
<body name="{side}_1" pos="{place}">
  <joint name="{side}_roll" axis="1 0 0" range="-1 1" {rotor}/>
  <inertial pos=".02 {mirror * 0.03} -.01" mass="2" fullinertia=".01 .012 .014 .001 .0005 -.0004"/>
  <body name="{side}_2" pos="0 {mirror * 0.1} 0">
    <joint name="{side}_pitch" axis="0 1 0" range="-1.2 1.2" {rotor}/>
    <inertial pos=".01 .02 -.15" mass="2.5" fullinertia=".03 .028 .012 .0005 .001 .0008"/>
    <body name="{side}_3" pos="0 0 -.35">
      <joint name="{side}_knee" axis="0 1 0" range="-1.2 1.2" {rotor}/>
      <inertial pos=".03 .01 -.12" mass="1.2" fullinertia=".012 .013 .004 .0003 .0006 .0002"/>
    </body>
  </body>
</body>"""


def _held(name: str, limbs: str, joints: int) -> str:
    speeds, accelerations = " ".join(["4"] * joints), " ".join(["40"] * joints)
    return f"""
<mujoco model="{name}">
  <compiler angle="radian"/>
  <custom>
    <numeric name="velocity_limit" data="{speeds}"/>
    <numeric name="acceleration_limit" data="{accelerations}"/>
  </custom>
  <worldbody><body name="trunk" pos="0 0 1">{limbs}</body></worldbody>
</mujoco>
"""


DUAL_ARM = _held("dual_arm", _limb("left", "0 .3 0", 1) + _limb("right", "0 -.3 0", -1), 6)
FOUR_LEGS = _held(
    "four_legs",
    "".join(
        _limb(f"{end}_{side}", f"{x} {0.15 * way} 0", way)
        for end, x in (("front", 0.3), ("rear", -0.3))
        for side, way in (("left", 1), ("right", -1))
    ),
    12,
)
