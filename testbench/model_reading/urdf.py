"""Rated speeds and accelerations of a URDF's joints, which MuJoCo drops."""

from pathlib import Path
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from identification.errors import InputError

from .limits import ACCELERATION, VELOCITY

Array = NDArray[np.float64]


def urdf_root(path: Path) -> ElementTree.Element | None:
    """The root of a URDF, None for a file that is none, or no XML at all."""
    try:
        root = ElementTree.parse(path).getroot()
    except (ElementTree.ParseError, OSError, UnicodeDecodeError, LookupError, ValueError):
        return None
    return root if root.tag == "robot" else None


def urdf_speeds(root: ElementTree.Element) -> dict[str, float]:
    """Rated speeds, rad/s (m/s), by joint: of ``<limit velocity>``, where zero stands for none given.

    Raises InputError for what is no number, or a negative one.
    """
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
        if speed > 0:
            speeds[name] = speed
    return speeds


def urdf_numerics(root: ElementTree.Element) -> dict[str, Array]:
    """The custom numerics inside a URDF's ``<mujoco>``, by name. Raises InputError for what is no number."""
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
