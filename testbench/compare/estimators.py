"""Which estimator: its error at each noise level, and its time."""

from collections.abc import Sequence

from identification.estimators import estimate, estimators
from identification.models import Preprocessing
from identification.parameters import GROUPS
from identification.pipeline import IdentificationOptions

from ..findings import torque_error
from ..jobs.identify import identify_recordings
from ..log import read_log
from ..scenario import Scenario
from .case import Case, Row
from .experiment import accuracy, experiment, motions_of, robot_of, timed

METRICS = ("over_bound", "prediction_error", "parameter_error", "inside", "seconds")
RECORDED = "recorded"


def choices() -> tuple[str, ...]:
    """Every estimator."""
    return tuple(sorted(estimators()))


def recorded_cases(scenario: Scenario, chosen: Sequence[str]) -> list[Case]:
    """Each estimator on a robot's own logs, each half predicting the other; none where the files are not."""
    recorded = scenario.comparison.recorded
    if recorded is None or not all(path.is_file() for path in (recorded.model, *recorded.halves)):
        return []
    section = scenario.identification
    settings = {"cutoff": section.cutoff, "dead_zone": section.dead_zone, "recorded": True}
    cases = []
    for seed, (fit, validation) in enumerate((recorded.halves, recorded.halves[::-1])):
        files = {"model": str(recorded.model), "fit": str(fit), "validation": str(validation)}
        cases += [Case("estimators", choice, RECORDED, seed, settings, files) for choice in chosen]
    return cases


def run(case: Case) -> Row:
    """Error and time of one estimator on one log."""
    if case.settings.get("recorded"):
        return _run_recorded(case)
    known = experiment(case, *motions_of(case))
    found, seconds = timed(lambda: estimate(known.problem, case.choice))
    return accuracy(found, known) | {"seconds": seconds, "exogeneity_p_value": found.exogeneity_p_value}


def _run_recorded(case: Case) -> Row:
    """Residual over RMS torque on the half fitted and on the other, all joints pooled."""
    fit, validation = (read_log(case.files[name]) for name in ("fit", "validation"))
    settings = case.settings
    preprocessing = Preprocessing(settings["cutoff"], "rloess", settings["dead_zone"])
    options = IdentificationOptions(case.choice, tuple(GROUPS), preprocessing)
    robot = robot_of(case)
    logs = {"fit": fit}, {"validation": validation}
    result, seconds = timed(lambda: identify_recordings(robot, *logs, options))
    row: Row = {"seconds": seconds}
    for name, fits in (("fit", result.fits), ("validation", result.validations)):
        error = torque_error(fits)
        row[f"{name}_residual"] = None if error is None else error.overall
    return row
