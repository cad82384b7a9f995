"""Meshes of a URDF: found, or left out with what refers to them."""

import os
from collections.abc import Callable, Mapping
from pathlib import Path
from xml.etree import ElementTree

import mujoco

from .packages import found_file
from .wording import listed

# Mesh formats of MuJoCo.
FORMATS = (".stl", ".obj", ".msh")


def place_meshes(
    root: ElementTree.Element, compiler: ElementTree.Element, path: Path, packages: Mapping[str, Path]
) -> list[str]:
    """Have a URDF's meshes found from its folder, and leave out shapes whose mesh is not.

    Returns sentences on what was left out.
    """
    if compiler.get("discardvisual", "true") == "true":
        for link in root.iterfind("link"):
            for visual in link.findall("visual"):
                link.remove(visual)
    missing, foreign = set(), set()
    for mesh in root.iterfind(".//mesh"):
        name = mesh.get("filename", "")
        place = found_file(name, path, compiler.get("meshdir", ""), packages)
        if place is None:
            missing.add(name)
        elif place.suffix.lower() not in FORMATS:
            foreign.add(name)
        else:
            mesh.set("filename", os.path.relpath(place, path.resolve().parent))
    compiler.set("meshdir", "")
    compiler.set("strippath", "false")
    notes = []
    if missing:
        why = f"meshes not found ({listed(sorted(missing))}; --package NAME=PATH says where a package is)"
        notes.append(_left_out(root, missing, why))
    if foreign:
        why = f"meshes of a format that MuJoCo does not read ({_files(foreign)})"
        notes.append(_left_out(root, foreign, why))
    return notes


def drop_broken(root: ElementTree.Element, folder: Path) -> str:
    """Leave out shapes whose mesh MuJoCo does not compile; a sentence on them, empty where there are none."""
    names = {mesh.get("filename", "") for mesh in root.iterfind(".//mesh")}
    broken = {name for name in names if not _compiles(name, folder)}
    return _left_out(root, broken, f"meshes that MuJoCo cannot read ({_files(broken)})") if broken else ""


def _files(names: set[str]) -> str:
    """Names of files in a sentence, without their folders."""
    return listed(sorted(name.rpartition("/")[2] for name in names))


def _left_out(root: ElementTree.Element, names: set[str], why: str) -> str:
    links = _drop_shapes(root, lambda mesh: mesh.get("filename", "") in names)
    return f"{why}: left out of pictures and clearance, at {listed(links)}"


def _drop_shapes(root: ElementTree.Element, drops: Callable[[ElementTree.Element], bool]) -> list[str]:
    """Take out shapes whose mesh is to be dropped; names of their links."""
    links = []
    for link in root.iterfind("link"):
        shapes = [shape for tag in ("collision", "visual") for shape in link.findall(tag)]
        dropped = [shape for shape in shapes if any(drops(mesh) for mesh in shape.iterfind("geometry/mesh"))]
        for shape in dropped:
            link.remove(shape)
        if dropped:
            links.append(link.get("name", ""))
    return links


def _compiles(name: str, folder: Path) -> bool:
    """Whether MuJoCo compiles a mesh by itself."""
    spec = mujoco.MjSpec()
    spec.modelfiledir = str(folder)
    spec.add_mesh(name="mesh", file=name)
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname="mesh")
    try:
        spec.compile()
    except (ValueError, mujoco.FatalError):
        return False
    return True
