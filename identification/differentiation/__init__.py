"""Velocities and accelerations from measured positions; one method a file, found by import."""

import importlib
import pkgutil
from collections.abc import Callable, Mapping

from ..errors import InputError
from ..signals import Motion, Signals

Differentiation = Callable[[Motion, float], Signals]


def differentiation_methods() -> Mapping[str, Differentiation]:
    """Every method by name: a function of the motion and the cut-off in Hz."""
    found = {}
    for info in pkgutil.iter_modules(__path__):
        module = importlib.import_module(f"{__name__}.{info.name}")
        found[info.name] = module.differentiate
    return found


def differentiate(motion: Motion, method: str, cutoff: float) -> Signals:
    """Filtered q, dq, ddq of one run by the named method; ``cutoff`` in Hz.

    Raises InputError for a method that does not exist, a cut-off that the sample rate cannot
    carry, or a run too short for it.
    """
    methods = differentiation_methods()
    if method not in methods:
        raise InputError(
            "differentiation", "method", "a differentiation method", repr(method), sorted(methods)
        )
    return methods[method](motion, cutoff)
