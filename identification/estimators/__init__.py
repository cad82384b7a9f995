"""Estimators of base parameters; one a file, found by import, one interface.

An estimator is a module with ``estimate(problem) -> Estimate``; its name is the file's.
"""

import importlib
import pkgutil
from collections.abc import Callable, Mapping

from ..errors import InputError
from ..estimate import Estimate
from ..problem import Problem

# Those that take a problem's prior; the others need a motion that excites every base parameter.
WITH_PRIOR = ("ols", "wls", "irls", "didim", "output_error", "physically_consistent")

Estimator = Callable[[Problem], Estimate]


def estimators() -> Mapping[str, Estimator]:
    """Every estimator by name."""
    return {name: _load(name) for name in _names()}


def estimate(problem: Problem, estimator: str) -> Estimate:
    """Estimate the base parameters of ``problem`` by the named estimator; only that one is loaded.

    Raises InputError for an estimator that does not exist and for a motion that leaves some base
    parameter unexcited.
    """
    if estimator not in _names():
        raise InputError("identification", "estimator", "an estimator", repr(estimator), _names())
    return _load(estimator)(problem)


def _names() -> list[str]:
    return sorted(info.name for info in pkgutil.iter_modules(__path__))


def _load(name: str) -> Estimator:
    return importlib.import_module(f"{__name__}.{name}").estimate
