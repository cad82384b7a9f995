"""Identification of logged runs: files in, estimate.json and report.html out."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from identification.errors import InputError
from identification.filtering import require_cutoff
from identification.models import Preprocessing
from identification.observations import POSITION_BAND
from identification.parameters import GROUPS
from identification.physical_consistency import consistent_standard_parameters
from identification.pipeline import IdentificationOptions, identify
from recordings.checks import require_sound

from ..closed_loop import recorded_loops
from ..estimate_file import write_estimate
from ..files import require_writable
from ..log import Recording
from ..lost_samples import lost_samples, mended
from ..model_file import write_model
from ..model_reading.reading import Choice
from ..report import write_report
from ..results import IdentificationResult
from ..robot import Robot, load_robot, print_notes
from ..runs import by_path, read_runs, run_names
from ..sampling import motion
from ..summary import print_summary


def identify_logs(
    model: Path,
    logs: Sequence[Path],
    validation_logs: Sequence[Path],
    out: Path,
    options: IdentificationOptions,
    identified_model: Path | None = None,
    map_path: Path | None = None,
    choice: Choice | None = None,
    joint_names: Sequence[str] | None = None,
) -> IdentificationResult:
    """Identify the logs, write DIR/estimate.json and DIR/report.html, print the summary.

    identified_model: MJCF to write with the nearest physically consistent parameters. map_path: how
    recordings that are no robot-logs are read. choice: of the model; joint_names, of the first log, are the
    robot's where it names none. Raises InputError.
    """
    paths = [*logs, *validation_logs]
    require_writable(out / "estimate.json")
    if identified_model is not None:
        require_writable(identified_model, model, *paths)
    robot = load_robot(model, choice, joint_names)
    print_notes(robot)
    runs = list(zip(run_names(paths), read_runs(paths, robot, map_path), strict=True))
    result = identify_runs(robot, dict(runs[: len(logs)]), dict(runs[len(logs) :]), options, paths)
    write_results(result, out)
    if identified_model is not None:
        write_identified_model(result, identified_model)
    print_summary(result)
    return result


def options_of(
    estimator: str = "wls",
    model: str = "inverse_dynamic",
    differentiation: str = "rloess",
    parameters: Sequence[str] | None = None,
    cutoff: float = 20.0,
    dead_zone: float = 0.02,
    strict: bool = False,
) -> IdentificationOptions:
    """What is identified and how; each joint's cut-off is lowered to what its encoder's noise leaves.

    model: the equations. parameters: groups, all when None. cutoff: Hz. dead_zone: rad/s. strict: as of
    IdentificationOptions. Raises InputError.
    """
    groups = tuple(GROUPS) if parameters is None else tuple(parameters)
    preprocessing = Preprocessing(cutoff, differentiation, dead_zone, model)
    return IdentificationOptions(estimator, groups, preprocessing, strict, own_bands=True)


def identify_runs(
    robot: Robot,
    fitted: dict[str, Recording],
    validated: dict[str, Recording],
    options: IdentificationOptions,
    paths: Sequence[Path],
) -> IdentificationResult:
    """Check the runs, identify those fitted, predict the others.

    fitted, validated: by name, no name in both. paths: their files, in that order, which errors name.
    Raises InputError.
    """
    runs = fitted | validated
    findings = require_sound(robot, runs, paths)
    for path, recording in zip(paths, runs.values(), strict=True):
        _require_long_enough(path, recording, options)
    try:
        result = identify_recordings(robot, fitted, validated, options)
    except InputError as error:
        # What simulates the runs, or stacks them, does not know their files.
        raise by_path(error, paths[: len(fitted)]) from None
    return replace(result, log_findings=findings)


def write_results(result: IdentificationResult, out: Path) -> None:
    """Write DIR/estimate.json and DIR/report.html."""
    write_estimate(result, out / "estimate.json")
    write_report(result, out / "report.html")


def write_identified_model(result: IdentificationResult, path: Path) -> None:
    """Write an MJCF with the nearest parameters of a robot that can exist. Raises InputError."""
    found = result.estimate
    standard = found.standard
    if standard is None:
        standard = consistent_standard_parameters(
            found.base, found.values, found.covariance, result.robot.parameters
        )
    write_model(result.robot, standard, path)


def identify_recordings(
    robot: Robot,
    fitted: dict[str, Recording],
    validated: dict[str, Recording],
    options: IdentificationOptions,
) -> IdentificationResult:
    """Identify recordings by name; the result has no comparison with a truth."""
    fitted, of_fitted = _mended(fitted)
    validated, of_validated = _mended(validated)
    found = identify(
        robot.chain,
        robot.parameters,
        {name: motion(recording) for name, recording in fitted.items()},
        {name: motion(recording) for name, recording in validated.items()},
        options,
        recorded_loops(robot, tuple(fitted.values())),
    )
    return IdentificationResult(
        robot=robot,
        estimate=found.estimate,
        fits=found.fits,
        validations=found.validations,
        fit_recordings=tuple(fitted.values()),
        validation_recordings=tuple(validated.values()),
        residual_tests=found.residual_tests,
        essential=found.essential,
        mended=of_fitted + of_validated,
        given=found.given,
        bands=found.bands,
        shrinkage=found.shrinkage,
        determination=found.determination,
    )


def _mended(recordings: dict[str, Recording]) -> tuple[dict[str, Recording], int]:
    """The recordings with samples that were lost on the way interpolated, and how many those are."""
    lost = {name: lost_samples(recording) for name, recording in recordings.items()}
    whole = {name: mended(recording, lost[name]) for name, recording in recordings.items()}
    return whole, sum(int(each.sum()) for each in lost.values())


def _require_long_enough(path: Path, recording: Recording, options: IdentificationOptions) -> None:
    """Raise InputError where a log is too short for the filters."""
    rate = recording.sample_rate
    try:
        cutoff = POSITION_BAND * options.preprocessing.at(rate).cutoff
        require_cutoff(cutoff, rate, len(recording.time))
    except InputError as error:
        raise error.located(path) from None
