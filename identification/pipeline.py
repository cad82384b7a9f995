"""From raw runs to an estimate: filter, write the equations, estimate, validate."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from .base_parameters import base_parameters
from .chain import Chain
from .closed_loop import ClosedLoop
from .estimate import Estimate, TorqueFit
from .estimators import estimate
from .models import Preprocessing, observe
from .parameters import DEFAULT_GROUPS
from .problem import Problem
from .signals import Motion
from .validation import torque_fit


@dataclass(frozen=True)
class IdentificationOptions:
    """What is identified and how. groups: of standard parameters, see parameters.GROUPS."""

    estimator: str = "wls"
    groups: Sequence[str] = DEFAULT_GROUPS
    preprocessing: Preprocessing = field(default_factory=Preprocessing)


def identify(
    chain: Chain,
    nominal: NDArray[np.float64],
    runs: Mapping[str, Motion],
    validation_runs: Mapping[str, Motion],
    options: IdentificationOptions,
    closed_loop: ClosedLoop | None = None,
) -> tuple[Estimate, tuple[TorqueFit, ...], tuple[TorqueFit, ...]]:
    """The estimate, how it fits the runs it was made from, and how it predicts the others.

    nominal: (14 n,) standard parameters of the model as given. Runs by name. closed_loop: simulates
    ``runs``, in their order, for the estimators that need it. Raises InputError for
    runs that are too short or excite too little, and for unknown estimators, groups, identification
    models or differentiation methods.
    """
    base = base_parameters(chain, options.groups)
    fitted = [observe(chain, base, motion, options.preprocessing, name) for name, motion in runs.items()]
    motions = tuple(runs.values())
    problem = Problem(chain, base, tuple(fitted), motions, options.preprocessing, nominal, closed_loop)
    found = estimate(problem, options.estimator)
    # Whatever equations it was found by, an estimate is judged by the torque it predicts.
    torques = replace(options.preprocessing, model="inverse_dynamic")
    if options.preprocessing.model != torques.model:
        fitted = [observe(chain, base, motion, torques, name) for name, motion in runs.items()]
        std, _ = replace(problem, observations=tuple(fitted)).residual_std(found.values)
        found = replace(found, noise_std=std)
    fits = tuple(torque_fit(found, run) for run in fitted)
    validations = tuple(
        torque_fit(found, observe(chain, base, motion, torques, name))
        for name, motion in validation_runs.items()
    )
    return found, fits, validations
