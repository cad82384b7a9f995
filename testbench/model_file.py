"""A robot's model written as MJCF, with the files that it refers to beside it."""

import hashlib
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from xml.etree import ElementTree

import mujoco
import numpy as np
from numpy.typing import NDArray

from identification.chain import frame_with_z
from identification.errors import InputError
from identification.parameters import ARMATURE, COULOMB, INERTIAL, PER_JOINT, VISCOUS, pseudo_inertia

from .files import replacing
from .model_reading.meshes import FORMATS
from .robot import Robot

Array = NDArray[np.float64]

# Hexadecimal digits of a file's content in the name of its copy.
DIGITS = 8
# Attributes of an asset that name files, and the folder that they are found from.
FILES = ("file", "fileright", "fileleft", "fileup", "filedown", "filefront", "fileback")
FOLDERS = {"mesh": "meshdir", "skin": "meshdir", "hfield": "meshdir", "texture": "texturedir"}


def write_model(robot: Robot, standard: Array, path: str | Path) -> None:
    """Write the robot's model with other standard parameters (14 links,), whole or not at all.

    Inertia, armature, damping and frictionloss are replaced, all else is kept; the file loads in
    plain MuJoCo. A link's inertia goes to the body that carries its joint, bodies welded to it keep
    none. A constant torque offset has no place in MJCF and is left out. Raises InputError for
    parameters that MuJoCo refuses, and for inertia between joints that share a body.
    """
    path = Path(path)
    table = np.asarray(standard, dtype=np.float64).reshape(-1, PER_JOINT)
    model, names = robot.model, robot.chain.tree.joint_names
    if robot.chain.followers is not None:
        table = table[robot.chain.followers.place]
    for joint in range(model.njnt - 1):
        if model.jnt_bodyid[joint] == model.jnt_bodyid[joint + 1] and np.any(table[joint, :INERTIAL] != 0):
            raise InputError(path, names[joint], "no inertia between joints of one body", "some")
    root = _as_mjcf(robot)
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
    write_mjcf(root, robot, path, "parameters that MuJoCo accepts")


def write_mjcf(root: ElementTree.Element, robot: Robot, path: Path, expected: str) -> None:
    """Write the MJCF tree of a robot's model, whole or not at all, with the files that it refers to.

    They are copied to the folder NAME_files beside ``path``, so that both load wherever they are taken.
    expected: what MuJoCo is to accept. Raises InputError where it does not.
    """
    ElementTree.indent(root)
    with _files_beside(root, robot.path.resolve().parent, path), replacing(path) as temporary:
        ElementTree.ElementTree(root).write(temporary, encoding="utf-8")
        try:
            mujoco.MjModel.from_xml_path(str(temporary))
        except (ValueError, mujoco.FatalError) as error:
            raise InputError(path, "model", expected, str(error)) from None


@contextmanager
def _files_beside(root: ElementTree.Element, home: Path, path: Path) -> Iterator[None]:
    """Have the files that the tree refers to beside ``path``; none where the block fails.

    home: folder that the tree finds them from.
    """
    compiler = root.find("compiler")
    compiled = {} if compiler is None else compiler.attrib
    folders = {kind: compiled.pop(kind, "") for kind in set(FOLDERS.values())}
    # A name then has its folder.
    compiled.pop("strippath", None)
    folder = path.parent / f"{path.stem}_files"
    made: list[Path] = []
    try:
        for asset in root.iterfind("asset/*"):
            for kind in FILES:
                if name := asset.get(kind):
                    source = home / folders[FOLDERS[asset.tag]] / name
                    copy = _copied(source, home, folder, made, f"{asset.tag} {kind}")
                    asset.set(kind, f"{folder.name}/{copy}")
        yield
    except BaseException:
        for each in made:
            each.unlink(missing_ok=True)
        with suppress(OSError):
            folder.rmdir()
        raise


def _copied(source: Path, home: Path, folder: Path, made: list[Path], field: str) -> str:
    """Name of the copy of a file in ``folder``, named after its content, so that it replaces no other.

    Raises InputError for a file that is not there, and for what is no mesh and not below the model's folder:
    a stranger's model must not carry off a picture.
    """
    if source.suffix.lower() not in FORMATS and not source.resolve().is_relative_to(home):
        raise InputError(home, field, "a file below the model's folder", source)
    try:
        content = source.read_bytes()
    except OSError as error:
        raise InputError(source, field, "a file that the model is read with", error.strerror) from None
    digest = hashlib.sha256(content).hexdigest()[:DIGITS]
    stem = source.stem.removesuffix(f"-{digest}")
    copy = folder / f"{stem}-{digest}{source.suffix}"
    if not copy.is_file():
        with replacing(copy) as temporary:
            temporary.write_bytes(content)
        made.append(copy)
    return copy.name


def _as_mjcf(robot: Robot) -> ElementTree.Element:
    """The model as one MJCF tree whose explicit inertias count."""
    spec = robot.spec()
    own = spec.compiler
    # What rescales or replaces the written inertias is switched off.
    own.inertiafromgeom = mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_AUTO
    own.settotalmass = -1
    own.boundmass = own.boundinertia = 0
    own.balanceinertia = 0
    return ElementTree.fromstring(spec.to_xml())


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
