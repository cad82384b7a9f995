"""The catalogue of what drives and their joints have beyond a model: one effect a file, found by import.

An effect's file has ``EFFECT``. ``command/``: on the way of the command; ``drive/``: in the drive;
``joint/``: in the joint.
"""

import importlib
import pkgutil
from collections.abc import Mapping
from functools import cache

from .base import DriveEffect


@cache
def drive_effects() -> Mapping[str, DriveEffect]:
    """Every effect by name, in alphabetical order."""
    names = [each.name for each in pkgutil.walk_packages(__path__, f"{__name__}.") if not each.ispkg]
    found = [
        module.EFFECT for module in map(importlib.import_module, sorted(names)) if hasattr(module, "EFFECT")
    ]
    return {each.name: each for each in sorted(found, key=lambda each: each.name)}
