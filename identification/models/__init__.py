"""Identification models: from filtered signals to linear equations; one a file, found by import.

A model is a module with ``equations(chain, base, signals, preprocessing, name) -> Observations``;
its name is the file's.
"""

import importlib
import pkgutil
from collections.abc import Callable, Mapping
from dataclasses import replace

from ..base_parameters import BaseParameters
from ..chain import Chain
from ..differentiation import differentiate
from ..errors import InputError
from ..observations import POSITION_BAND, Observations, Preprocessing
from ..signals import Motion, Signals
from ..springs import spring_torque

__all__ = ["POSITION_BAND", "Observations", "Preprocessing", "equations", "identification_models", "observe"]

IdentificationModel = Callable[[Chain, BaseParameters, Signals, Preprocessing, str], Observations]


def identification_models() -> Mapping[str, IdentificationModel]:
    """Every identification model by name."""
    names = [info.name for info in pkgutil.iter_modules(__path__)]
    return {name: importlib.import_module(f"{__name__}.{name}").equations for name in names}


def observe(
    chain: Chain, base: BaseParameters, motion: Motion, preprocessing: Preprocessing, name: str = "run"
) -> Observations:
    """Filter one run and write its identification equations.

    Raises InputError when the run is too short for the filters, its shape is not the chain's, or
    the identification model does not exist.
    """
    if motion.position.shape[1] != chain.joints:
        raise InputError(name, "joint/position", f"{chain.joints} joints", motion.position.shape[1])
    settings = preprocessing.at(motion.sample_rate)
    signals = differentiate(motion, settings.differentiation, POSITION_BAND * settings.cutoff)
    return equations(chain, base, signals, settings, name)


def equations(
    chain: Chain, base: BaseParameters, signals: Signals, preprocessing: Preprocessing, name: str
) -> Observations:
    """The equations of a filtered run by the model that ``preprocessing`` names.

    What the joints' springs need is known, and taken off the torque. Raises InputError for a model that
    does not exist.
    """
    models = identification_models()
    if preprocessing.model not in models:
        raise InputError(
            "identification", "model", "an identification model", repr(preprocessing.model), sorted(models)
        )
    unsprung = replace(signals, tau=signals.tau - spring_torque(chain.springs, signals.q))
    return models[preprocessing.model](chain, base, unsprung, preprocessing, name)
