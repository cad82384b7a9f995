"""Which differentiation: its velocity and acceleration, and the parameters that are then found."""

from dataclasses import replace

import numpy as np

from identification.differentiation import differentiate, differentiation_methods
from identification.estimators import estimate
from identification.observations import POSITION_BAND

from .case import Case, Row
from .experiment import accuracy, experiment, motions_of, scenario_of, timed

METRICS = ("acceleration_error", "velocity_error", "prediction_error", "over_bound", "seconds")


def choices() -> tuple[str, ...]:
    """Every differentiation method."""
    return tuple(sorted(differentiation_methods()))


def run(case: Case) -> Row:
    """Errors and time of one method on one log; the scenario's estimator does the rest.

    velocity_error, acceleration_error: RMS over RMS, median over joints.
    """
    scenario = scenario_of(case)
    section = scenario.identification.model_copy(update={"differentiation": case.choice})
    settings = case.settings["scenario"] | {"identification": section.model_dump(mode="json")}
    known = experiment(replace(case, settings=case.settings | {"scenario": settings}), *motions_of(case))
    (run,) = known.problem.motions
    band = POSITION_BAND * known.problem.preprocessing.at(run.sample_rate).cutoff
    signals, seconds = timed(lambda: differentiate(run, case.choice, band))
    inside = slice(signals.trim, len(signals.q) - signals.trim)
    errors = {}
    for name, found in (("velocity", signals.dq), ("acceleration", signals.ddq)):
        truth = known.recording.truth[name][inside]
        wrong = np.sqrt(np.mean((found[inside] - truth) ** 2, axis=0) / np.mean(truth**2, axis=0))
        errors[f"{name}_error"] = float(np.median(wrong))
    found = estimate(known.problem, section.estimator)
    return errors | accuracy(found, known) | {"seconds": seconds}
