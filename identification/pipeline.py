"""From raw runs to an estimate: filter, write the equations, estimate, validate."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from .band import Bands, joint_bands
from .base_parameters import base_parameters
from .chain import Chain
from .closed_loop import ClosedLoop
from .determination import Determination
from .estimate import Estimate, TorqueFit
from .estimators import estimate
from .held_estimate import held_estimate
from .models import Preprocessing, observe
from .parameters import DEFAULT_GROUPS
from .problem import SINGULAR_CONDITION, Problem
from .shrinkage import Shrinkage
from .signals import Motion
from .springs import spring_torque
from .statistics import EssentialParameters, ResidualTests, essential_parameters, residual_tests
from .validation import torque_fit


@dataclass(frozen=True)
class IdentificationOptions:
    """What is identified and how. groups: of standard parameters, see parameters.GROUPS.

    strict: a motion that leaves a base parameter open is refused; otherwise the model's value holds it.
    own_bands: each joint's cut-off is lowered to what its encoders' noise leaves.
    """

    estimator: str = "wls"
    groups: Sequence[str] = DEFAULT_GROUPS
    preprocessing: Preprocessing = field(default_factory=Preprocessing)
    strict: bool = True
    own_bands: bool = False


@dataclass(frozen=True)
class Identification:
    """An estimate and how it stands up.

    fits, validations: the torque that it predicts along the runs it was made from, and along the others.
    residual_tests: of the torque residual of the runs it was made from. essential: the base parameters that
    the equations fitted cannot do without, None where the runs leave some open. given: the torque that the
    model as given predicts along the runs of fits and validations. bands: of each joint, where they are its
    own. shrinkage, determination: how far from the model the runs let the estimate, and what they tell; None
    where it is strict.
    """

    estimate: Estimate
    fits: tuple[TorqueFit, ...]
    validations: tuple[TorqueFit, ...]
    residual_tests: ResidualTests
    essential: EssentialParameters | None
    given: tuple[TorqueFit, ...]
    bands: Bands | None = None
    shrinkage: Shrinkage | None = None
    determination: Determination | None = None


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
    motions = tuple(runs.values())
    settings, bands = options.preprocessing, None
    if options.own_bands:
        widest = max(settings.at(motion.sample_rate).cutoff for motion in motions)
        bands = joint_bands(chain, nominal, motions, widest)
        settings = replace(settings, joint_cutoffs=tuple(bands.cutoff.tolist()))
    fitted = [observe(chain, base, motion, settings, name) for name, motion in runs.items()]
    problem = Problem(chain, base, tuple(fitted), motions, settings, nominal, closed_loop)
    if options.strict:
        found, chosen, determined = estimate(problem, options.estimator), None, None
    else:
        held = held_estimate(problem, options.estimator)
        found, chosen, determined = held.estimate, held.shrinkage, held.determination
    # Dropping a parameter says nothing where a prior is what holds it.
    is_open = found.condition_number > SINGULAR_CONDITION
    essential = None if is_open else essential_parameters(problem, found)
    # Whatever equations it was found by, an estimate is judged by the torque it predicts.
    torques = replace(settings, model="inverse_dynamic")
    if settings.model != torques.model:
        fitted = [observe(chain, base, motion, torques, name) for name, motion in runs.items()]
        problem = replace(problem, observations=tuple(fitted))
        std, _ = problem.residual_std(found.values)
        found = replace(found, noise_std=std)
    others = [observe(chain, base, motion, torques, name) for name, motion in validation_runs.items()]
    moved = [_unsprung(chain, motion) for motion in (*motions, *validation_runs.values())]
    predicted = [
        torque_fit(values, run, raw)
        for values in (found.values, base.values(nominal))
        for run, raw in zip([*fitted, *others], moved, strict=True)
    ]
    count = len(moved)
    return Identification(
        estimate=found,
        fits=tuple(predicted[: len(fitted)]),
        validations=tuple(predicted[len(fitted) : count]),
        residual_tests=residual_tests(problem, found),
        essential=essential,
        given=tuple(predicted[count:]),
        bands=bands,
        shrinkage=chosen,
        determination=determined,
    )


def _unsprung(chain: Chain, motion: Motion) -> Motion:
    """The run with what the joints' springs need taken off the torque."""
    return replace(motion, torque=motion.torque - spring_torque(chain.springs, motion.position))
