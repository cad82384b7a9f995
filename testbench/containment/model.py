"""Models of strangers: looked through, compiled where that may fail, and checked, before they are used."""

from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import mujoco
import numpy as np

from identification.errors import InputError

from ..model_reading.assets import compiled_mjcf
from .child import contained

EXPECTED = "XML that MuJoCo loads"
# Bytes of a model's own text, and of all files that it names.
LONGEST_XML, MOST_OF_ALL = 1 << 24, 1 << 30
# Nested elements, files included by files, and copies that are made of one element.
DEEPEST, MOST_INCLUDES, MOST_COPIES = 100, 10, 1000
# Parts of a compiled model, and its bytes with those of the state that is simulated.
MOST_PARTS = {"nbody": 1000, "njnt": 1000, "ngeom": 20_000, "ntendon": 1000, "nactuator": 1000, "nflex": 0}
MOST_MEMORY = 1 << 30
# Attributes that name files.
FILES = ("file", "filename")
FOLDERS = ("meshdir", "texturedir", "assetdir")
# Arrays whose numbers must be finite; a range may be infinite.
FINITE = (
    "qpos0",
    "qpos_spring",
    "body_pos",
    "body_quat",
    "body_ipos",
    "body_iquat",
    "body_mass",
    "body_inertia",
    "body_gravcomp",
    "jnt_pos",
    "jnt_axis",
    "jnt_stiffness",
    "jnt_stiffnesspoly",
    "dof_armature",
    "dof_damping",
    "dof_dampingpoly",
    "dof_frictionloss",
    "geom_pos",
    "geom_quat",
    "geom_size",
    "actuator_gear",
    "actuator_gainprm",
    "actuator_biasprm",
)
RANGES = ("jnt_range", "jnt_actfrcrange", "actuator_forcerange", "actuator_ctrlrange", "numeric_data")


def require_readable(path: Path) -> None:
    """Raise InputError for a model that names what none needs, or that MuJoCo cannot or should not compile.

    It is looked through and compiled elsewhere: MuJoCo crashes on some files, and takes all time or memory on
    others. A URDF is changed before MuJoCo compiles it; who changes it calls ``require_sound_model``.
    """
    size = contained("testbench.containment.model:_referred", path, "model", EXPECTED)
    contained("testbench.containment.model:_checked", path, "model", EXPECTED, size=size)


def _compiled(path: Path) -> Any:
    try:
        _leave_no_log_file()
        return compiled_mjcf(path)[1]
    except (ValueError, mujoco.FatalError) as error:
        raise InputError(path, "model", EXPECTED, str(error)) from None


def _leave_no_log_file() -> None:
    """Keep MuJoCo's warnings on stderr alone; it would also write MUJOCO_LOG.TXT where the user stands."""
    config = mujoco.MjLogConfig.get()
    config.logto_file = False
    mujoco.MjLogConfig.set(config)


def _referred(name: str) -> int:
    """Bytes of all regular files that a model names. Raises InputError for what no model needs."""
    path = Path(name)
    return _look_through(path, path.parent.resolve(), [path])


def _look_through(path: Path, tree: Path, chain: list[Path]) -> int:
    """The same for one of its files. tree: folder that included files lie in. chain: the files before it."""
    size = path.stat().st_size
    if size > LONGEST_XML:
        raise InputError(path, "model", f"at most {LONGEST_XML >> 20} MiB of XML", f"{size} bytes")
    try:
        root = _parsed(path)
    except ElementTree.ParseError:
        # What MuJoCo says of it is more to the point; it reads no file before it has read this.
        return size
    folders = {chain[0].parent, path.parent}
    for element in root.iter():
        folders |= {chain[0].parent / element.get(kind, "") for kind in FOLDERS if element.get(kind)}
    for element in root.iter():
        for attribute in FILES:
            value = element.get(attribute)
            if not value:
                continue
            places = [folder / value.removeprefix("file://").removeprefix("package://") for folder in folders]
            found = [place for place in places if _exists(place)]
            for place in found:
                if not place.is_file():
                    raise InputError(path, f"{element.tag} {attribute}", "a regular file", place)
            if element.tag == "include":
                for place in found:
                    size += _included(path, place, tree, chain)
            elif found:
                size += max(place.stat().st_size for place in found)
        if size > MOST_OF_ALL:
            raise InputError(
                path, "model", f"files of at most {MOST_OF_ALL >> 20} MiB together", f"{size} bytes"
            )
    return size


def _included(path: Path, place: Path, tree: Path, chain: list[Path]) -> int:
    if not place.resolve().is_relative_to(tree):
        raise InputError(path, "include file", f"a file below the model's folder {tree}", place)
    if len(chain) > MOST_INCLUDES or place.resolve() in [each.resolve() for each in chain]:
        raise InputError(
            path, "include file", f"at most {MOST_INCLUDES} files, none of which includes itself", place
        )
    return _look_through(place, tree, [*chain, place])


def _exists(path: Path) -> bool:
    try:
        return path.exists() and not path.is_dir()
    # A name with a null character, or one that is too long.
    except (OSError, ValueError):
        return False


def _parsed(path: Path) -> ElementTree.Element:
    """The XML of a file. Raises InputError for nesting and copies that no model has, and ParseError."""
    depth, copies = 0, [1.0]
    root = None
    for event, element in ElementTree.iterparse(path, ("start", "end")):
        own = _copies(path, element) if element.tag == "replicate" else 1.0
        if event == "end":
            depth -= 1
            if own > 1:
                copies.pop()
            root = element
            continue
        depth += 1
        if own > 1:
            copies.append(copies[-1] * own)
        if depth > DEEPEST:
            raise InputError(path, "model", f"at most {DEEPEST} nested elements", "more")
        if copies[-1] > MOST_COPIES:
            raise InputError(path, "replicate count", f"at most {MOST_COPIES} copies", f"{copies[-1]:g}")
    assert root is not None
    return root


def _copies(path: Path, element: ElementTree.Element) -> float:
    try:
        return max(1.0, float(element.get("count", "1")))
    except ValueError:
        return 1.0


def _checked(name: str) -> None:
    """Compile an MJCF to see whether that can be done. Raises InputError where it cannot be worked with."""
    path = Path(name)
    if _is_mjcf(path):
        require_sound_model(path, _compiled(path))


def _is_mjcf(path: Path) -> bool:
    """Whether a file is to be compiled as it is: it is no URDF."""
    try:
        return ElementTree.parse(path).getroot().tag != "robot"
    except (ElementTree.ParseError, UnicodeDecodeError, LookupError, ValueError):
        # What MuJoCo says of it is more to the point.
        return True


def require_sound_model(path: Path, model: Any) -> None:
    """Raise InputError for a compiled model that is too large, or whose numbers and names are none."""
    for kind, most in MOST_PARTS.items():
        if getattr(model, kind) > most:
            raise InputError(path, kind, f"at most {most}", getattr(model, kind))
    memory = int(model.nbuffer) + int(model.narena)
    if memory > MOST_MEMORY:
        expected = f"a model and a state of at most {MOST_MEMORY >> 20} MiB"
        raise InputError(path, "model", expected, f"{memory >> 20} MiB")
    _require_texts(path, model)
    _require_numbers(path, model)


def _require_texts(path: Path, model: Any) -> None:
    """Raise InputError for a name that is no UTF-8, or has characters that are no text."""
    for raw in bytes(model.names).split(b"\0"):
        try:
            text = raw.decode("utf-8")
        except UnicodeDecodeError:
            raise InputError(path, "name", "text in UTF-8", repr(raw)) from None
        if not text.isprintable():
            raise InputError(path, "name", "printable characters", repr(text))


def _require_numbers(path: Path, model: Any) -> None:
    for field in (*FINITE, *RANGES):
        values = np.asarray(getattr(model, field))
        bad = np.isnan(values) if field in RANGES else ~np.isfinite(values)
        if bad.any():
            index = np.argwhere(bad)[0]
            kind, what = field.split("_")[0], {"jnt": "joint", "dof": "joint"}
            raise InputError(
                path,
                field,
                "finite numbers",
                f"{values[tuple(index)]} of {what.get(kind, kind)} {index[0] + 1}",
            )
    if not np.isfinite(model.opt.gravity).all():
        raise InputError(path, "gravity", "finite numbers", model.opt.gravity.tolist())
