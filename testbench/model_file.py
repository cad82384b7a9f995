"""An identified model, written back as MJCF."""

import os
from pathlib import Path
from xml.etree import ElementTree

import mujoco
import numpy as np
from numpy.typing import NDArray

from identification.chain import frame_with_z
from identification.errors import InputError
from identification.parameters import ARMATURE, COULOMB, INERTIAL, PER_JOINT, VISCOUS, pseudo_inertia

from .files import replacing
from .robot import Robot

Array = NDArray[np.float64]


def write_model(robot: Robot, standard: Array, path: str | Path) -> None:
    """Write the robot's model with other standard parameters (14 n,), whole or not at all.

    Inertia, armature, damping and frictionloss are replaced, all else is kept; the file loads in
    plain MuJoCo. A link's inertia goes to the body that carries its joint, bodies welded to it keep
    none. A constant torque offset has no place in MJCF and is left out. Raises InputError for
    parameters that MuJoCo refuses, and for inertia between joints that share a body.
    """
    path = Path(path)
    table = np.asarray(standard, dtype=np.float64).reshape(robot.joints, PER_JOINT)
    model = robot.model
    for joint in range(robot.joints - 1):
        if model.jnt_bodyid[joint] == model.jnt_bodyid[joint + 1] and np.any(table[joint, :INERTIAL] != 0):
            raise InputError(path, robot.joint_names[joint], "no inertia between joints of one body", "some")
    root = _as_mjcf(robot, path.parent)
    joint = -1
    for body in root.iterfind("./worldbody//body"):
        own = _own_joints(body)
        for element in own:
            joint += 1
            element.set("armature", repr(float(table[joint, ARMATURE])))
            element.set("damping", repr(float(table[joint, VISCOUS])))
            element.set("frictionloss", repr(float(table[joint, COULOMB])))
        if own:
            axes, anchor = frame_with_z(model.jnt_axis[joint]), model.jnt_pos[joint]
            _set_inertia(body, _moved(table[joint, :INERTIAL], axes, anchor))
        elif joint >= 0:
            _set_inertia(body, np.zeros((4, 4)))
    ElementTree.indent(root)
    with replacing(path) as temporary:
        ElementTree.ElementTree(root).write(temporary, encoding="utf-8")
        try:
            mujoco.MjModel.from_xml_path(str(temporary))
        except (ValueError, mujoco.FatalError) as error:
            raise InputError(path, "model", "parameters that MuJoCo accepts", str(error)) from None


def _as_mjcf(robot: Robot, folder: Path) -> ElementTree.Element:
    """The model as one MJCF tree whose explicit inertias count and whose assets are found from ``folder``."""
    spec = robot.spec()
    own = spec.compiler
    folders = {kind: robot.path.parent.resolve() / getattr(own, kind) for kind in ("meshdir", "texturedir")}
    # What rescales or replaces the written inertias is switched off.
    own.inertiafromgeom = mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_AUTO
    own.settotalmass = -1
    own.boundmass = own.boundinertia = 0
    own.balanceinertia = 0
    root = ElementTree.fromstring(spec.to_xml())
    compiler = root.find("compiler")
    if root.find("asset//*[@file]") is not None and compiler is not None:
        for kind, path in folders.items():
            compiler.set(kind, os.path.relpath(path, folder.resolve()))
    return root


def _own_joints(element: ElementTree.Element) -> list[ElementTree.Element]:
    """The joints of a body, directly in it or in frames, not those of the bodies it carries."""
    joints = []
    for child in element:
        if child.tag == "joint":
            joints.append(child)
        elif child.tag == "frame":
            joints += _own_joints(child)
    return joints


def _moved(inertial: Array, axes: Array, origin: Array) -> Array:
    """Pseudo-inertia (4, 4) in a frame where the link frame has these axes (columns) and origin."""
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = axes, origin
    return pose @ pseudo_inertia(inertial) @ pose.T


def _set_inertia(body: ElementTree.Element, pseudo: Array) -> None:
    """Give the body this pseudo-inertia, in its own frame, in place of whatever it had."""
    for old in body.findall("inertial"):
        body.remove(old)
    mass = pseudo[3, 3]
    center = pseudo[:3, 3] / mass if mass > 0 else np.zeros(3)
    second = pseudo[:3, :3] - mass * np.outer(center, center)
    inertia = np.trace(second) * np.eye(3) - second
    values = {"pos": center, "mass": [mass]}
    # MuJoCo wants a positive definite full inertia, but takes a zero diagonal one.
    if mass > 0:
        values["fullinertia"] = inertia[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
    else:
        values["diaginertia"] = np.zeros(3)
    text = {name: " ".join(repr(float(v)) for v in numbers) for name, numbers in values.items()}
    body.insert(0, ElementTree.Element("inertial", text))
