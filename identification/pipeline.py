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
from .statistics import EssentialParameters, ResidualTests, essential_parameters, residual_tests
from .validation import torque_fit


@dataclass(frozen=True)
class IdentificationOptions:
    """What is identified and how. groups: of standard parameters, see parameters.GROUPS."""

    estimator: str = "wls"
    groups: Sequence[str] = DEFAULT_GROUPS
    preprocessing: Preprocessing = field(default_factory=Preprocessing)


@dataclass(frozen=True)
class Identification:
    """An estimate and how it stands up.

    fits, validations: the torque that it predicts along the runs it was made from, and along the others.
    residual_tests: of the torque residual of the runs it was made from. essential: the base parameters that
    the equations fitted cannot do without.
    """

    estimate: Estimate
    fits: tuple[TorqueFit, ...]
    validations: tuple[TorqueFit, ...]
    residual_tests: ResidualTests
    essential: EssentialParameters


def identify(
    chain: Chain,
    nominal: NDArray[np.float64],
    runs: Mapping[str, Motion],
    validation_runs: Mapping[str, Motion],
    options: IdentificationOptions,
    closed_loop: ClosedLoop | None = None,
) -> Identification:
    """The estimate of the named runs, how it fits them and how it predicts the others.

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
    essential = essential_parameters(problem, found)
    # Whatever equations it was found by, an estimate is judged by the torque it predicts.
    torques = replace(options.preprocessing, model="inverse_dynamic")
    if options.preprocessing.model != torques.model:
        fitted = [observe(chain, base, motion, torques, name) for name, motion in runs.items()]
        problem = replace(problem, observations=tuple(fitted))
        std, _ = problem.residual_std(found.values)
        found = replace(found, noise_std=std)
    fits = tuple(torque_fit(found, run) for run in fitted)
    validations = tuple(
        torque_fit(found, observe(chain, base, motion, torques, name))
        for name, motion in validation_runs.items()
    )
    return Identification(found, fits, validations, residual_tests(problem, found), essential)
