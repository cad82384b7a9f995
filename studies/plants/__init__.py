"""Robots of six kinds, drawn by seed, that share no physics with the simulator and the diagnosis.

Each plant is one file with a ``PLANT``, found by import; ``draw`` returns its robot of a seed.
"""

import importlib
import pkgutil
from functools import cache

import identification.compiled  # noqa: F401  kernels of the plants are kept where it says
from identification.errors import InputError

from .case import Case, Fault
from .drawing import Plant, drawn

__all__ = ["Case", "Fault", "Plant", "draw", "plant", "plants"]


@cache
def plants() -> tuple[str, ...]:
    """Names of all plants."""
    return tuple(sorted(_found()))


def plant(name: str) -> Plant:
    """The plant of this name. Raises InputError with the known names."""
    if name not in _found():
        raise InputError("plants", "plant", "a plant", repr(name), plants())
    return _found()[name]


def draw(name: str, seed: int, healthy: bool = False) -> Case:
    """The robot of a plant and seed; healthy: without its faults. Raises InputError for an unknown plant."""
    return drawn(plant(name), seed, healthy)


@cache
def _found() -> dict[str, Plant]:
    modules = (
        importlib.import_module(f".{module.name}", __name__) for module in pkgutil.iter_modules(__path__)
    )
    found = [module.PLANT for module in modules if hasattr(module, "PLANT")]
    return {each.name: each for each in found}
