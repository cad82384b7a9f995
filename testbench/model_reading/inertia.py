"""Inertias of a URDF's links: what no body can have is moved to the nearest that one can."""

from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from identification.errors import InputError

Array = NDArray[np.float64]
ELEMENTS = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
# Second moments below zero by less than this share of their sum are rounding.
ROUNDING = 1e-3
# Smallest second moment of a body: a share of its largest, and mass times the square of a length, m.
LEAST_SHARE, LEAST_RADIUS = 1e-9, 3e-6


def mend_inertia(link: ElementTree.Element) -> bool:
    """Whether a link's inertia was none that a body can have; it is changed in place to one.

    With the second moment S = tr(I)/2 - I a body has S >= 0, which is A + B >= C of its principal
    moments: negative eigenvalues of S are raised to next to zero. An ``<inertial>`` without mass is
    taken out. Raises InputError for a negative mass and for what is no number.
    """
    inertial = link.find("inertial")
    if inertial is None:
        return False
    mass = _number(link, inertial, "mass", "value")
    if mass < 0:
        raise InputError("model", f"mass of {link.get('name')}", "at least 0 kg", f"{mass:g}")
    values = [_number(link, inertial, "inertia", name) for name in ELEMENTS]
    xx, xy, xz, yy, yz, zz = values
    if mass == 0:
        link.remove(inertial)
        return any(values)
    inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    second = np.trace(inertia) / 2 * np.eye(3) - inertia
    moments, axes = np.linalg.eigh(second)
    least = max(LEAST_SHARE * float(np.abs(moments).max()), LEAST_RADIUS**2 * mass)
    if moments.min() >= least:
        return False
    impossible = bool(moments.min() < -ROUNDING * np.abs(moments).sum())
    possible = axes @ np.diag(np.maximum(moments, least)) @ axes.T
    inertia = np.trace(possible) * np.eye(3) - possible
    for name, value in zip(ELEMENTS, inertia[np.triu_indices(3)], strict=True):
        element = inertial.find("inertia")
        if element is None:
            element = ElementTree.SubElement(inertial, "inertia")
        element.set(name, repr(float(value)))
    return impossible


def _number(link: ElementTree.Element, inertial: ElementTree.Element, tag: str, name: str) -> float:
    """An attribute of a child of ``<inertial>``, 0 where it is missing."""
    element = inertial.find(tag)
    text = "0" if element is None else element.get(name, "0")
    try:
        value = float(text)
    except ValueError:
        value = np.nan
    if not np.isfinite(value):
        raise InputError("model", f"{tag} {name} of {link.get('name')}", "a number", repr(text))
    return value
