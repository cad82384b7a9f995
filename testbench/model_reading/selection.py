"""Which joints of a model are the robot, and which are held still."""

from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass, field
from typing import Any

import mujoco
import numpy as np

from identification.errors import InputError
from identification.followers import JOINT_EQUALITY, carries, followed, obstacle
from identification.joint_names import joint_label

from .limits import leaders_range, own_range
from .urdf import LEAST

HINGE_OR_SLIDE = (int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE))
FREE, BALL = int(mujoco.mjtJoint.mjJNT_FREE), int(mujoco.mjtJoint.mjJNT_BALL)
TENDON_EQUALITY = int(mujoco.mjtEq.mjEQ_TENDON)
TENDON_DRIVE = int(mujoco.mjtTrn.mjTRN_TENDON)
JOINT_WRAP = int(mujoco.mjtWrap.mjWRAP_JOINT)
# kg: what moves and has less than this has no mass, see LEAST.
WEIGHTLESS = 1e3 * float(LEAST)


@dataclass(frozen=True)
class Selection:
    """Joints by their index in the whole model.

    kept: the robot's. held: free joints of a base that is held. ignored: bodies that are taken out with all
    that they carry. following: joints that follow one of the robot's. hindered: why others that would are
    held, by joint.
    """

    kept: tuple[int, ...]
    held: tuple[int, ...]
    ignored: tuple[int, ...]
    following: tuple[int, ...] = ()
    hindered: Mapping[int, str] = field(default_factory=dict)

    @property
    def moving(self) -> tuple[int, ...]:
        """Joints that are not held still."""
        return tuple(sorted((*self.kept, *self.following)))


def select(
    model: Any, asked: Sequence[str] | None, fix_base: bool, leaders: Set[str] = frozenset()
) -> Selection:
    """The robot's joints in a compiled model.

    asked: their names. None: all hinges and slides but those of grippers (see ``_of_grippers``), and of
    what floats beside a robot on a fixed base. None of them follows another. A floating
    base is held where ``fix_base``, or where joints are asked for that it carries. leaders: names of joints
    that others follow which are no joints of the model. Raises InputError for unknown names, and for a
    floating base that nobody said to hold.
    """
    every = [joint for joint in range(model.njnt) if model.jnt_type[joint] in HINGE_OR_SLIDE]
    floats = {joint: _carried(model, joint) for joint in range(model.njnt) if model.jnt_type[joint] == FREE}
    if asked is not None:
        kept = _named(model, asked, every)
        held = tuple(joint for joint, carried in floats.items() if carried & set(kept))
    else:
        # The chain says that balls do not serve.
        every += [joint for joint in range(model.njnt) if model.jnt_type[joint] == BALL]
        every.sort()
        floating = set().union(*floats.values())
        fixed = [joint for joint in every if joint not in floating]
        held = () if fixed or not floating else tuple(joint for joint, carried in floats.items() if carried)
        if held and not fix_base:
            base = model.body(model.jnt_bodyid[held[0]]).name or joint_label(model, held[0])
            expected = "a fixed base: --fix-base holds it, as logs or --joints of its joints alone do"
            raise InputError("model", "base", expected, f"{base}, which floats")
        among = set(fixed or floating)
        kept = tuple(joint for joint in every if joint in among)
        without = _of_grippers(model, set(kept), leaders)
        kept = tuple(joint for joint in kept if joint not in without)
    if not kept:
        # The chain says what is wrong with that.
        return Selection(tuple(range(model.njnt)), (), ())
    ignored = tuple(int(model.jnt_bodyid[joint]) for joint in floats if joint not in held)
    following, hindered = _led(model, set(kept), ignored)
    kept = tuple(joint for joint in kept if joint not in following and joint not in hindered)
    return Selection(kept, held, ignored, following, hindered)


def _led(model: Any, kept: set[int], ignored: Sequence[int]) -> tuple[tuple[int, ...], dict[int, str]]:
    """The joints that follow one of those kept, and why some of them cannot, by joint."""
    found = {
        joint: follows
        for joint, follows in followed(model).items()
        if follows.leader in kept and model.body_rootid[model.jnt_bodyid[joint]] not in ignored
    }
    hindered: dict[int, str] = {}
    for joint, follows in sorted(found.items(), key=lambda each: len(each[1].through)):
        stuck = [each for each in follows.through if each in hindered or each not in found]
        reason = obstacle(model, joint, follows, kept - found.keys())
        lower, upper = own_range(model, follows.leader)
        least, most = leaders_range(model, joint, follows)
        if stuck:
            hindered[joint] = f"{joint_label(model, stuck[0])} is held"
        elif reason:
            hindered[joint] = reason
        elif model.body_subtreemass[model.jnt_bodyid[joint]] < WEIGHTLESS:
            hindered[joint] = "it moves nothing with a mass"
        elif not max(lower, least) < min(upper, most):
            hindered[joint] = f"its range leaves {joint_label(model, follows.leader)} none"
    return tuple(sorted(found.keys() - hindered.keys())), hindered


def _named(model: Any, asked: Sequence[str], every: Sequence[int]) -> tuple[int, ...]:
    """Indices of the joints of these names, in the model's order."""
    known = {joint_label(model, joint): joint for joint in every}
    for name in asked:
        if name not in known:
            raise InputError("model", "joints", "hinges or slides of the model", repr(name), known)
    if not asked:
        raise InputError("model", "joints", "at least one joint", "none", known)
    return tuple(sorted({known[name] for name in asked}))


def _carried(model: Any, free: int) -> set[int]:
    """The hinges and slides that a free joint's body carries."""
    body = int(model.jnt_bodyid[free])
    return {
        joint
        for joint in range(model.njnt)
        if model.jnt_type[joint] in HINGE_OR_SLIDE and model.body_rootid[model.jnt_bodyid[joint]] == body
    }


def _of_grippers(model: Any, joints: set[int], leaders: Set[str]) -> set[int]:
    """Joints that others follow or that follow others, beyond which no joint moves by itself: of a gripper.

    They are coupled by an active joint equality (a URDF's mimic), or by one fixed tendon, but for one that
    only brakes, as a drive shared by two joints does; a leader's followers may be fixed. Where other joints
    lie beyond a coupled one, as in a parallelogram, all of that group stay.
    """
    groups = [{joint} for joint in joints if joint_label(model, joint) in leaders]
    for equality in np.flatnonzero((model.eq_type == JOINT_EQUALITY) & model.eq_active0):
        pair = {int(model.eq_obj1id[equality]), int(model.eq_obj2id[equality])}
        groups.append(pair - {-1})
    for tendon in range(model.ntendon):
        wraps = slice(model.tendon_adr[tendon], model.tendon_adr[tendon] + model.tendon_num[tendon])
        if np.all(model.wrap_type[wraps] == JOINT_WRAP) and not _only_brakes(model, tendon):
            groups.append({int(joint) for joint in model.wrap_objid[wraps]})
    merged: list[set[int]] = []
    for group in groups:
        together = [each for each in merged if each & group]
        merged = [each for each in merged if not each & group] + [group.union(*together)]
    coupled = set().union(*merged) if merged else set()
    apart = joints - coupled
    return {
        joint
        for group in merged
        if not any(carries(model, inner, outer) for outer in apart for inner in group)
        for joint in group & joints
    }


def _only_brakes(model: Any, tendon: int) -> bool:
    """Whether all that a tendon does is friction: nothing drives it, and it holds nothing together."""
    driven = (model.actuator_trntype == TENDON_DRIVE) & (model.actuator_trnid[:, 0] == tendon)
    tied = (model.eq_type == TENDON_EQUALITY) & ((model.eq_obj1id == tendon) | (model.eq_obj2id == tendon))
    holds = driven.any() or tied.any() or model.tendon_stiffness[tendon] or model.tendon_limited[tendon]
    brakes = model.tendon_frictionloss[tendon] or model.tendon_damping[tendon]
    return bool(brakes and not holds)
