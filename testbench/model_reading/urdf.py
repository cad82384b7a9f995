"""A URDF as it comes, made into one that MuJoCo reads; what MuJoCo drops of it is kept beside."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import mujoco
import numpy as np
from numpy.typing import NDArray

from identification.errors import InputError

from .inertia import mend_inertia
from .limits import ACCELERATION, VELOCITY
from .meshes import drop_broken, place_meshes
from .wording import listed

Array = NDArray[np.float64]

# Elements that a parent has once: ROS reads the first.
ONCE = {
    "link": ("inertial",),
    "inertial": ("origin", "mass", "inertia"),
    "collision": ("origin", "geometry"),
    "visual": ("origin", "geometry", "material"),
    "joint": ("origin", "parent", "child", "axis", "limit", "dynamics", "mimic", "calibration"),
}
# kg, kg·m² of a body that has none: next to nothing, but MuJoCo wants some of every body that moves.
LEAST = "1e-12"
# rad/s (m/s): what no drive of an arm or a leg does; such numbers fill a field that must not be empty.
NO_RATING = 100.0
# rad (m): a joint that may go so far has no range, whatever its field holds.
NO_RANGE = 1e3
MOVING = ("revolute", "continuous", "prismatic")


@dataclass(frozen=True)
class Urdf:
    """A URDF that MuJoCo reads from ``folder``.

    speeds: rated, rad/s (m/s), by joint. leaders: joints that move, and that some follow (mimic) which the
    file has fixed. numerics: custom numerics of its ``<mujoco>``. notes: sentences on what was left out or
    changed.
    """

    root: ElementTree.Element
    folder: Path
    speeds: dict[str, float]
    leaders: frozenset[str]
    numerics: dict[str, Array]
    notes: tuple[str, ...]


def xml_root(path: Path) -> ElementTree.Element | None:
    """The root of a model's XML, None where it is none."""
    try:
        return ElementTree.parse(path).getroot()
    # What MuJoCo says of it is more to the point.
    except (ElementTree.ParseError, OSError, UnicodeDecodeError, LookupError, ValueError):
        return None


def read_urdf(root: ElementTree.Element, path: Path, packages: Mapping[str, Path]) -> Urdf:
    """A URDF made into what MuJoCo reads, in place. packages: folders by name.

    Meshes that are missing, or of a format that MuJoCo does not read, are left out; inertias that no body
    has are moved to the nearest that one can have. Raises InputError for what is no number.
    """
    notes = []
    repeated = _drop_repeated(root)
    if repeated:
        notes.append(f"given twice, the first counts: {listed(repeated)}")
    leaders = _leaders_of_fixed(root)
    _drop_what_is_none(root)
    impossible = [link.get("name", "") for link in root.iterfind("link") if mend_inertia(link)]
    if impossible:
        notes.append(
            f"inertia that no body has, taken as the nearest that one can have: {listed(impossible)}"
        )
    compiler = _compiler(root)
    notes += place_meshes(root, compiler, path, packages)
    # A link without <inertial> has no mass: MuJoCo would fill its shapes with water, or refuse it.
    for name, value in (("inertiafromgeom", "false"), ("boundmass", LEAST), ("boundinertia", LEAST)):
        compiler.attrib.setdefault(name, value)
    return Urdf(root, path.resolve().parent, _speeds(root), leaders, _numerics(root), tuple(notes))


def compiled_urdf(urdf: Urdf) -> tuple[Any, Any, tuple[str, ...]]:
    """The MjSpec and MjModel of a URDF, and a sentence on meshes that MuJoCo cannot read, which are left out.

    Raises ValueError as MuJoCo does.
    """
    spec = _parsed(urdf)
    try:
        return spec, spec.compile(), ()
    except (ValueError, mujoco.FatalError):
        note = drop_broken(urdf.root, urdf.folder)
        if not note:
            raise
    spec = _parsed(urdf)
    return spec, spec.compile(), (note,)


def _parsed(urdf: Urdf) -> Any:
    spec = mujoco.MjSpec.from_string(ElementTree.tostring(urdf.root, encoding="unicode"))
    spec.modelfiledir = str(urdf.folder)
    return spec


def _drop_repeated(root: ElementTree.Element) -> list[str]:
    """Leave the first of what an element has once; names of the parents of what was taken out."""
    names = []
    for parent in [root, *root.iter()]:
        seen: set[str] = set()
        for child in list(parent):
            if child.tag in ONCE.get(parent.tag, ()):
                if child.tag in seen:
                    parent.remove(child)
                    names.append(f"{child.tag} of {parent.get('name', parent.tag)}")
                seen.add(child.tag)
    return names


def _leaders_of_fixed(root: ElementTree.Element) -> frozenset[str]:
    """Joints that move, and that some follow which do not."""
    moving = _moving(root)
    return frozenset(
        mimic.get("joint", "")
        for joint in root.iterfind("joint")
        for mimic in joint.iterfind("mimic")
        if joint.get("name") not in moving and mimic.get("joint") in moving
    )


def _moving(root: ElementTree.Element) -> set[str | None]:
    return {joint.get("name") for joint in root.iterfind("joint") if joint.get("type") in MOVING}


def _drop_what_is_none(root: ElementTree.Element) -> None:
    """Take out mimics among joints that do not move, ranges of no width and ranges without an end."""
    moving = _moving(root)
    for joint in root.iterfind("joint"):
        mimic, limit = joint.find("mimic"), joint.find("limit")
        if mimic is not None and not {joint.get("name"), mimic.get("joint")} <= moving:
            joint.remove(mimic)
        if limit is not None and (_no_width(limit) or _endless(limit)):
            del limit.attrib["lower"], limit.attrib["upper"]


def _no_width(limit: ElementTree.Element) -> bool:
    return limit.get("lower") is not None and limit.get("lower") == limit.get("upper")


def _endless(limit: ElementTree.Element) -> bool:
    """Whether a range is so large that it is none."""
    try:
        return min(-float(limit.get("lower", "nan")), float(limit.get("upper", "nan"))) >= NO_RANGE
    # What MuJoCo says of it is more to the point.
    except ValueError:
        return False


def _compiler(root: ElementTree.Element) -> ElementTree.Element:
    """The ``<mujoco><compiler>`` of a URDF, made where there is none."""
    mujoco_element = root.find("mujoco")
    if mujoco_element is None:
        mujoco_element = ElementTree.SubElement(root, "mujoco")
    compiler = mujoco_element.find("compiler")
    return ElementTree.SubElement(mujoco_element, "compiler") if compiler is None else compiler


def _speeds(root: ElementTree.Element) -> dict[str, float]:
    """Rated speeds by joint, of ``<limit velocity>``; zero and NO_RATING or more stand for none given."""
    speeds = {}
    for joint in root.iterfind("joint"):
        limit, name = joint.find("limit"), joint.get("name", "")
        text = None if limit is None else limit.get("velocity")
        if text is None:
            continue
        try:
            speed = float(text)
        except ValueError:
            speed = np.nan
        if not speed >= 0:
            raise InputError("model", f"limit velocity of {name}", "a number of at least 0 rad/s", repr(text))
        if 0 < speed < NO_RATING:
            speeds[name] = speed
    return speeds


def _numerics(root: ElementTree.Element) -> dict[str, Array]:
    found = {}
    for numeric in root.iterfind("mujoco/custom/numeric"):
        name, text = numeric.get("name", ""), numeric.get("data", "")
        if name not in (VELOCITY, ACCELERATION):
            continue
        try:
            found[name] = np.array([float(word) for word in text.split()])
        except ValueError:
            raise InputError("model", f"custom numeric {name}", "numbers", repr(text)) from None
    return found
