"""A model with all but the robot's joints held still: the same bodies, fewer joints."""

from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from identification.errors import InputError
from identification.followers import JOINT_EQUALITY, followed
from identification.joint_names import joint_label

from .selection import FREE, HINGE_OR_SLIDE, JOINT_WRAP, Selection
from .wording import listed

Array = NDArray[np.float64]
# Rotation (3, 3) and translation (3,) m.
Pose = tuple[Array, Array]

HOME = "home"
SLIDE = int(mujoco.mjtJoint.mjJNT_SLIDE)
BALL = int(mujoco.mjtJoint.mjJNT_BALL)
JOINT_DRIVES = (mujoco.mjtTrn.mjTRN_JOINT, mujoco.mjtTrn.mjTRN_JOINTINPARENT)


def lock(spec: Any, model: Any, selection: Selection) -> tuple[str, ...]:
    """Hold every joint that does not move where the keyframe or zero has it; sentences on what was done.

    spec is changed in place; model is what it compiled to. Bodies keep their mass. Free bodies that are
    ignored, keyframes, sensors and whatever acts on held joints alone are taken out. Raises InputError for
    a tendon that pulls on a joint that moves and one that is held.
    """
    kept = set(selection.moving)
    gone = [joint for joint in range(model.njnt) if joint not in kept]
    elements = list(spec.joints)
    for joint in selection.moving if gone or selection.following else ():
        elements[joint].name = joint_label(model, joint)
    if not gone:
        return _following(model, selection)
    out = _subtrees(model, selection.ignored)
    qpos, where = standing(model)
    notes = _notes(model, selection, out, where)
    _drop_what_refers(spec, model, kept, out)
    _pose_bodies(spec, model, kept, qpos, out)
    for joint in gone:
        spec.delete(elements[joint])
    bodies = {body.id: body for body in spec.bodies}
    for body in selection.ignored:
        spec.delete(bodies[body])
    return notes


def _notes(model: Any, selection: Selection, out: set[int], where: str) -> tuple[str, ...]:
    notes = []
    locked = [
        joint_label(model, joint)
        for joint in range(model.njnt)
        if joint not in selection.moving
        and model.jnt_type[joint] != FREE
        and model.jnt_bodyid[joint] not in out
    ]
    if locked:
        notes.append(f"held still {where}, its mass counted: {listed(locked)}")
    if selection.held:
        names = [model.body(model.jnt_bodyid[joint]).name for joint in selection.held]
        notes.append(f"floating base held: {listed(names)}")
    if selection.ignored:
        notes.append(f"ignored, free bodies: {listed([model.body(body).name for body in selection.ignored])}")
    return tuple(notes) + _following(model, selection)


def _following(model: Any, selection: Selection) -> tuple[str, ...]:
    """Sentences on the joints that follow one of the robot's, and on those that would but are held."""
    notes, found = [], followed(model)
    for joint in selection.following:
        ratio, leader = found[joint].ratio, joint_label(model, found[joint].leader)
        notes.append(f"{joint_label(model, joint)} moves with {leader}, {ratio:g} times as far")
    which = np.flatnonzero((model.eq_type == JOINT_EQUALITY) & model.eq_active0 & (model.eq_obj2id >= 0))
    for joint, other in zip(model.eq_obj1id[which].tolist(), model.eq_obj2id[which].tolist(), strict=True):
        if joint in selection.moving or (other not in selection.moving and joint not in selection.hindered):
            continue
        first = found[joint].leader if joint in selection.hindered else other
        name, leader = joint_label(model, joint), joint_label(model, first)
        reason = f" as {selection.hindered[joint]}" if joint in selection.hindered else ""
        cost = f"{leader} has its weight as it stands, and lacks its inertia and friction"
        notes.append(f"{name} follows {leader}, but is held still here{reason}: {cost}")
    return tuple(notes)


def standing(model: Any) -> tuple[Array, str]:
    """The positions (nq,) of the keyframe called home, else of the first, else zero within the ranges."""
    if model.nkey:
        names = [model.key(key).name for key in range(model.nkey)]
        key = names.index(HOME) if HOME in names else 0
        called = f" {names[key]}" if names[key] else ""
        return np.array(model.key_qpos[key]), f"at keyframe{called}"
    qpos = np.array(model.qpos0)
    for joint in range(model.njnt):
        if model.jnt_type[joint] in HINGE_OR_SLIDE:
            bounds = model.jnt_range[joint] if model.jnt_limited[joint] else (-np.inf, np.inf)
            qpos[model.jnt_qposadr[joint]] = np.clip(0.0, *bounds)
    return qpos, "at zero"


def _subtrees(model: Any, roots: Sequence[int]) -> set[int]:
    """These bodies and all that they carry."""
    found = set(roots)
    for body in range(1, model.nbody):
        if int(model.body_parentid[body]) in found:
            found.add(body)
    return found


def _links(model: Any, kept: set[int]) -> Array:
    """The last joint of the robot that moves each body (nbody,), -1 where none does."""
    link = np.full(model.nbody, -1)
    for body in range(1, model.nbody):
        start, count = int(model.body_jntadr[body]), int(model.body_jntnum[body])
        own = [joint for joint in range(start, start + count) if joint in kept]
        link[body] = own[-1] if own else link[model.body_parentid[body]]
    return link


def _drop_what_refers(spec: Any, model: Any, kept: set[int], out: set[int]) -> None:
    """Take out keyframes, sensors, and what acts on held joints alone or refers to bodies that go."""
    for element in (*spec.keys, *spec.sensors, *spec.tuples, *spec.skins):
        spec.delete(element)
    links = _links(model, kept)
    tendons = {tendon.id for tendon in spec.tendons if _acts(model, tendon.id, kept, links, out)}
    # What is deleted changes the numbers of all after it: everything is found first.
    gone = [each for each in spec.actuators if not _drives(model, each, kept, tendons)]
    gone += [each for each in spec.equalities if not _ties(model, each.id, kept, links, tendons, out)]
    gone += [each for each in spec.tendons if each.id not in tendons]
    for element in gone:
        spec.delete(element)
    names = {model.body(body).name for body in out}
    shapes = {model.geom(geom).name for geom in range(model.ngeom) if int(model.geom_bodyid[geom]) in out}
    for exclude in list(spec.excludes):
        if {exclude.bodyname1, exclude.bodyname2} & names:
            spec.delete(exclude)
    for pair in list(spec.pairs):
        if {pair.geomname1, pair.geomname2} & shapes:
            spec.delete(pair)
    for looking in (*spec.cameras, *spec.lights):
        if looking.targetbody in names:
            spec.delete(looking)


def _drives(model: Any, actuator: Any, kept: set[int], tendons: set[int]) -> bool:
    """Whether an actuator (MjsActuator) drives a joint that moves, or a tendon that pulls on some."""
    target = int(model.actuator_trnid[actuator.id, 0])
    on_joint = actuator.trntype in JOINT_DRIVES and target in kept
    return on_joint or (actuator.trntype == mujoco.mjtTrn.mjTRN_TENDON and target in tendons)


def _acts(model: Any, tendon: int, kept: set[int], links: Array, out: set[int]) -> bool:
    """Whether a tendon pulls on joints that move. Raises InputError where it also pulls on a held one."""
    wraps = range(model.tendon_adr[tendon], model.tendon_adr[tendon] + model.tendon_num[tendon])
    objects = [(int(model.wrap_type[wrap]), int(model.wrap_objid[wrap])) for wrap in wraps]
    if all(kind == JOINT_WRAP for kind, _ in objects):
        moving = [joint for _, joint in objects if joint in kept]
        if not moving:
            return False
        held = [joint for _, joint in objects if joint not in kept]
        if held:
            got = f"{joint_label(model, held[0])}, held still, on tendon {model.tendon(tendon).name}"
            expected = f"all joints of a tendon with {joint_label(model, moving[0])}, or none (--joints)"
            raise InputError("model", "joints", expected, got)
        return True
    at_site = int(mujoco.mjtWrap.mjWRAP_SITE)
    bodies = {int(model.site_bodyid[index]) for kind, index in objects if kind == at_site}
    return not bodies & out and len({int(links[body]) for body in bodies}) > 1


def _ties(model: Any, equality: int, kept: set[int], links: Array, tendons: set[int], out: set[int]) -> bool:
    """Whether an equality ties bodies or joints that move against each other."""
    kind = mujoco.mjtEq(int(model.eq_type[equality]))
    objects = [int(model.eq_obj1id[equality]), int(model.eq_obj2id[equality])]
    if kind == mujoco.mjtEq.mjEQ_JOINT:
        return all(joint in kept or joint < 0 for joint in objects)
    if kind == mujoco.mjtEq.mjEQ_TENDON:
        return all(tendon in tendons or tendon < 0 for tendon in objects)
    if kind not in (mujoco.mjtEq.mjEQ_CONNECT, mujoco.mjtEq.mjEQ_WELD):
        return True
    if model.eq_objtype[equality] == mujoco.mjtObj.mjOBJ_SITE:
        objects = [int(model.site_bodyid[site]) for site in objects]
    return not set(objects) & out and len({int(links[body]) for body in objects}) > 1


def _pose_bodies(spec: Any, model: Any, kept: set[int], qpos: Array, out: set[int]) -> None:
    """Put the held joints' motion into the poses of their bodies, in place.

    A body's pose T is followed by its joints' motions, each in the body's own frame: T K1 L2 K3 L4 with K
    kept and L held is T' K1' K3' with T' = T L2 L4, K1' = (L2 L4)^-1 K1 (L2 L4) and K3' = L4^-1 K3 L4.
    """
    elements = list(spec.joints)
    for body in spec.bodies:
        index = body.id
        if index <= 0 or index in out or not model.body_jntnum[index]:
            continue
        start = int(model.body_jntadr[index])
        joints = range(start, start + int(model.body_jntnum[index]))
        if all(joint in kept for joint in joints):
            continue
        if model.jnt_type[start] == FREE:
            _stand(body, qpos[model.jnt_qposadr[start] :][:7], body.frame)
            continue
        after: Pose = (np.eye(3), np.zeros(3))
        for joint in reversed(joints):
            axis, anchor = np.array(model.jnt_axis[joint]), np.array(model.jnt_pos[joint])
            if joint not in kept:
                after = _after(_motion(model, joint, axis, anchor, qpos), after)
                continue
            elements[joint].axis = after[0].T @ axis
            elements[joint].pos = after[0].T @ (anchor - after[1])
        _move(body, after)


def _motion(model: Any, joint: int, axis: Array, anchor: Array, qpos: Array) -> Pose:
    """What a joint at its position in ``qpos`` does to its body, in the body's frame."""
    start = int(model.jnt_qposadr[joint])
    if model.jnt_type[joint] == BALL:
        rotation = _matrix(qpos[start : start + 4])
        return rotation, anchor - rotation @ anchor
    turned = float(qpos[start] - model.qpos0[start])
    if model.jnt_type[joint] == SLIDE:
        return np.eye(3), turned * axis
    quaternion = np.empty(4)
    mujoco.mju_axisAngle2Quat(quaternion, axis, turned)
    rotation = _matrix(quaternion)
    return rotation, anchor - rotation @ anchor


def _after(first: Pose, second: Pose) -> Pose:
    return first[0] @ second[0], first[0] @ second[1] + first[1]


def _move(body: Any, motion: Pose) -> None:
    """Put a motion in a body's own frame behind its pose."""
    quaternion = np.array(body.quat, dtype=float)
    if body.alt.type != mujoco.mjtOrientation.mjORIENTATION_QUAT:
        compiler = body.compiler
        quaternion = np.array(
            mujoco.MjSpec.resolve_orientation(
                degree=bool(compiler.degree), sequence=compiler.eulerseq, orientation=body.alt
            )
        )
        body.alt.type = mujoco.mjtOrientation.mjORIENTATION_QUAT
    rotation = _matrix(quaternion / np.linalg.norm(quaternion))
    pose = _after((rotation, np.array(body.pos)), motion)
    body.pos, body.quat = pose[1], _quaternion(pose[0])


def _stand(body: Any, qpos: Array, frame: Any) -> None:
    """Put a floating base where a keyframe has it; within a frame it stays where the model has it."""
    if frame is None:
        body.pos, body.quat = qpos[:3], qpos[3:] / np.linalg.norm(qpos[3:])
        body.alt.type = mujoco.mjtOrientation.mjORIENTATION_QUAT


def _matrix(quaternion: Array) -> Array:
    flat = np.empty(9)
    mujoco.mju_quat2Mat(flat, quaternion)
    return flat.reshape(3, 3)


def _quaternion(rotation: Array) -> Array:
    quaternion = np.empty(4)
    mujoco.mju_mat2Quat(quaternion, rotation.ravel())
    return quaternion
