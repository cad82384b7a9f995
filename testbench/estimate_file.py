"""estimate.json: the result of an identification, for machines."""

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from identification.statistics import ResidualTests

from .files import write_text
from .findings import TorqueError, noise_ratio, parameter_rows, torque_error, torque_unit
from .results import IdentificationResult


def write_estimate(result: IdentificationResult, path: str | Path) -> None:
    """Write estimate.json, whole or not at all. What is unknown, or not finite, is null."""
    text = json.dumps(estimate_document(result), ensure_ascii=False, indent=2, allow_nan=False)
    write_text(text + "\n", path)


def estimate_document(result: IdentificationResult) -> dict[str, Any]:
    """What estimate.json holds, as plain JSON types.

    torque_rms and relative_residual are per joint, over all runs of a kind, empty where there are none;
    torque_rms_unfiltered is of the torque as logged, above the cut-off too; given_relative_residual is that
    of the model as given; determined: which base parameters the runs determine better than the model did;
    percent_sigma in %; runs give each run's own torque RMS. essential and the tests are null where the result
    has none.
    """
    estimate, comparison, tests = result.estimate, result.comparison, result.residual_tests
    fit, validation = torque_error(result.fits), torque_error(result.validations)
    count = len(result.fits)
    given_fit, given_validation = torque_error(result.given[:count]), torque_error(result.given[count:])
    determined = (
        (None,) * estimate.base.count
        if result.determination is None
        else result.determination.determined.tolist()
    )
    return {
        "format": "identification-estimate",
        "format_version": 1,
        "robot": result.robot.name,
        "joint_names": list(result.robot.joint_names),
        "estimator": estimate.estimator,
        "base_parameters": [
            {
                "name": row.name,
                "value": _number(row.value),
                "std": _number(row.std),
                "truth": _number(row.truth),
                "unit": row.unit,
                "percent_sigma": _number(row.percent_sigma),
                "cramer_rao": _number(row.cramer_rao),
                "essential": needed,
                "determined": known,
            }
            for row, needed, known in zip(parameter_rows(result), result.needed, determined, strict=True)
        ],
        "torque_rms": {
            "fit": _per_joint(fit, "rms"),
            "validation": _per_joint(validation, "rms"),
            "unit": torque_unit(result.robot),
        },
        "relative_residual": {
            "fit": _per_joint(fit, "relative"),
            "validation": _per_joint(validation, "relative"),
            "unit": "1",
        },
        "torque_rms_unfiltered": {
            "fit": _per_joint(fit, "unfiltered"),
            "validation": _per_joint(validation, "unfiltered"),
            "unit": torque_unit(result.robot),
        },
        "given_relative_residual": {
            "fit": None if given_fit is None else _number(given_fit.overall),
            "validation": None if given_validation is None else _number(given_validation.overall),
            "unit": "1",
        },
        "cutoff": None if result.bands is None else {"value": _numbers(result.bands.cutoff), "unit": "Hz"},
        "encoder_torque": None
        if result.bands is None
        else {"value": _numbers(result.bands.encoder_torque), "unit": torque_unit(result.robot)},
        "determined": None
        if result.determination is None
        else {
            "combinations": result.determination.directions,
            "of": estimate.base.count,
            "remarks": list(result.determination.remarks),
        },
        "shrinkage": None
        if result.shrinkage is None
        else {"prior_strength": result.shrinkage.strength, "factor": result.shrinkage.factor},
        "overall_relative_residual": {
            "fit": None if fit is None else _number(fit.overall),
            "validation": None if validation is None else _number(validation.overall),
            "unit": "1",
        },
        "noise_floor": None if comparison is None else _numbers(comparison.noise_floor),
        "torque_over_noise_floor": _number(noise_ratio(result)),
        "condition_number": _number(estimate.condition_number),
        "effective_samples": _number(estimate.effective_samples),
        "residual_tests": None if tests is None else _tests(tests),
        "dropped_p_value": None if result.essential is None else _number(result.essential.p_value),
        "mended": result.mended,
        "runs": [
            {"name": run.name, "role": role, "torque_rms": _numbers(run.rms)}
            for role, runs in (("fit", result.fits), ("validation", result.validations))
            for run in runs
        ],
    }


def _tests(tests: ResidualTests) -> dict[str, list[float | None]]:
    """p-values and samples, one a joint."""
    return {
        "whiteness": _numbers(tests.whiteness),
        "normality": _numbers(tests.normality),
        "first_autocorrelation": _numbers(tests.first_autocorrelation),
        "independent_samples": _numbers(tests.independent_samples),
    }


def _per_joint(error: TorqueError | None, field: str) -> list[float | None]:
    return [] if error is None else _numbers(getattr(error, field))


def _numbers(values: NDArray[np.float64]) -> list[float | None]:
    return [_number(value) for value in values]


def _number(value: float | None) -> float | None:
    """JSON has no NaN and no infinity."""
    return None if value is None or not math.isfinite(value) else float(value)
