"""Meshes, textures and height fields of an MJCF that cannot be read: left out, with what refers to them."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import mujoco

from identification.errors import InputError

from .wording import listed


def compiled_mjcf(path: Path) -> tuple[Any, Any, tuple[str, ...]]:
    """The MjSpec and MjModel of an MJCF, and a sentence on assets that cannot be read, which are left out.

    Raises ValueError as MuJoCo does, and InputError where a body has its mass of a mesh that is left out.
    """
    spec = mujoco.MjSpec.from_file(str(path))
    try:
        return spec, spec.compile(), ()
    except (ValueError, mujoco.FatalError):
        # A spec that failed to compile is not used again.
        spec = mujoco.MjSpec.from_file(str(path))
        notes = _drop_unreadable(spec, path)
        if not notes:
            raise
    return spec, spec.compile(), notes


def _drop_unreadable(spec: Any, path: Path) -> tuple[str, ...]:
    """Leave out, in place, what MuJoCo cannot read by itself; sentences on it."""
    notes = []
    meshes = {_name(mesh): mesh for mesh in spec.meshes if not _reads(path, spec.meshdir, mesh=mesh)}
    if meshes:
        shapes = [geom for geom in spec.geoms if geom.meshname in meshes]
        for shape in shapes:
            _require_weightless(spec, shape, path)
        bodies = sorted({shape.parent.name for shape in shapes})
        _drop_shapes(spec, shapes)
        files = listed(sorted(mesh.file for mesh in meshes.values()))
        where = f", at {listed(bodies)}" if bodies else ""
        notes.append(f"meshes that MuJoCo cannot read ({files}): left out of pictures and clearance{where}")
    fields = {field.name: field for field in spec.hfields if not _reads(path, spec.meshdir, hfield=field)}
    _drop_shapes(spec, [geom for geom in spec.geoms if geom.hfieldname in fields and geom.hfieldname])
    images = {each.name: each for each in spec.textures if not _reads(path, spec.texturedir, texture=each)}
    for material in spec.materials:
        if set(material.textures) & set(images) - {""}:
            material.textures = ["" if name in images else name for name in material.textures]
    for kind, gone in (("height fields", fields), ("textures", images)):
        if gone:
            files = listed(sorted(each.file for each in gone.values()))
            notes.append(f"{kind} that MuJoCo cannot read ({files}): left out")
    for asset in (*meshes.values(), *fields.values(), *images.values()):
        spec.delete(asset)
    return tuple(notes)


def _name(asset: Any) -> str:
    """The name by which geoms call a mesh: its own, or its file's without folder and ending."""
    return asset.name or Path(asset.file).stem


def _reads(path: Path, folder: str, **asset: Any) -> bool:
    """Whether MuJoCo compiles one asset by itself; always where it has no file."""
    ((kind, element),) = asset.items()
    if not element.file:
        return True
    spec = mujoco.MjSpec()
    spec.modelfiledir = str(path.parent)
    spec.meshdir = spec.texturedir = folder
    if kind == "mesh":
        spec.add_mesh(name="one", file=element.file)
        spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname="one")
    elif kind == "hfield":
        spec.add_hfield(name="one", file=element.file, size=element.size)
        spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_HFIELD, hfieldname="one")
    else:
        spec.add_texture(name="one", file=element.file, type=element.type)
    try:
        spec.compile()
    except (ValueError, mujoco.FatalError):
        return False
    return True


def _require_weightless(spec: Any, shape: Any, path: Path) -> None:
    """Raise InputError where a body's mass comes of this shape."""
    body, compiler = shape.parent, spec.compiler
    by_shapes = compiler.inertiafromgeom == mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_TRUE or (
        compiler.inertiafromgeom == mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_AUTO
        and not body.explicitinertial
    )
    first, last = compiler.inertiagrouprange
    weighs = shape.mass != 0 and (shape.mass == shape.mass or shape.density > 0)
    if by_shapes and weighs and first <= shape.group <= last and body.name != "world":
        expected = f"its file, whose volume gives {body.name or 'its body'} its mass, or an <inertial> there"
        raise InputError(path, f"mesh {shape.meshname}", expected, "none that MuJoCo reads")


def _drop_shapes(spec: Any, shapes: Sequence[Any]) -> None:
    names = {shape.name for shape in shapes} - {""}
    for pair in list(spec.pairs):
        if {pair.geomname1, pair.geomname2} & names:
            spec.delete(pair)
    for shape in shapes:
        spec.delete(shape)
