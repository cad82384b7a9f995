"""The figures that the summary, the page, the session and estimate.json all quote."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identification.estimate import TorqueFit
from identification.parameters import standard_parameters

from .results import IdentificationResult

Array = NDArray[np.float64]

# A validation error up to this many times the noise floor is called "at the noise floor".
AT_NOISE_FLOOR = 1.2
# Larger numbers are written with an exponent.
LONGEST_INTEGER = 1e6


@dataclass(frozen=True)
class TorqueError:
    """Torque error of several runs taken together, over the samples that count.

    rms: (n,) N·m (N), NaN for a joint that never leaves rest. relative: (n,) residual RMS over torque
    RMS. overall: residual RMS over torque RMS with all joints pooled.
    """

    rms: Array
    relative: Array
    overall: float


@dataclass(frozen=True)
class ParameterRow:
    """One base parameter with all that is known of it; truth and what follows from it may be None.

    joint: from 0. error_std: error over standard deviation.
    """

    name: str
    unit: str
    joint: int
    value: float
    std: float
    percent_sigma: float
    truth: float | None
    error: float | None
    error_std: float | None
    cramer_rao: float | None


def torque_error(fits: Sequence[TorqueFit]) -> TorqueError | None:
    """The pooled torque error of these runs, or None when there are none."""
    if not fits:
        return None
    used = np.concatenate([fit.used for fit in fits])
    residual = np.where(used, np.concatenate([fit.measured - fit.predicted for fit in fits]), 0.0)
    torque = np.where(used, np.concatenate([fit.measured for fit in fits]), 0.0)
    residual_power, torque_power = np.sum(residual**2, axis=0), np.sum(torque**2, axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        rms = np.sqrt(residual_power / used.sum(axis=0))
        relative = np.sqrt(residual_power / torque_power)
        overall = float(np.sqrt(residual_power.sum() / torque_power.sum()))
    return TorqueError(rms, relative, overall)


def parameter_rows(result: IdentificationResult) -> tuple[ParameterRow, ...]:
    """One row a base parameter, in the order of the estimate."""
    estimate, comparison = result.estimate, result.comparison
    standard = standard_parameters(result.robot.chain.is_slide)
    rows = []
    for index, column in enumerate(estimate.base.columns):
        std = float(estimate.std[index])
        error = None if comparison is None else float(comparison.error[index])
        rows.append(
            ParameterRow(
                name=estimate.base.names[index],
                unit=estimate.base.units[index],
                joint=standard[column].joint,
                value=float(estimate.values[index]),
                std=std,
                percent_sigma=float(estimate.percent_sigma[index]),
                truth=None if comparison is None else float(comparison.truth[index]),
                error=error,
                error_std=None if error is None or std == 0 else error / std,
                cramer_rao=None if comparison is None else float(comparison.cramer_rao[index]),
            )
        )
    return tuple(rows)


def noise_ratio(result: IdentificationResult) -> float | None:
    """Torque error over what noise alone leaves, joints pooled; validation runs where there are any.

    None where noise is not known, or leaves nothing.
    """
    error = torque_error(result.validations or result.fits)
    if result.comparison is None or error is None:
        return None
    floor = result.comparison.noise_floor
    known = np.isfinite(error.rms) & np.isfinite(floor)
    alone = float(np.linalg.norm(floor[known]))
    return float(np.linalg.norm(error.rms[known])) / alone if alone > 0 else None


def within(result: IdentificationResult, deviations: float) -> int | None:
    """How many base parameters lie within that many standard deviations of the truth."""
    if result.comparison is None:
        return None
    return int(np.sum(np.abs(result.comparison.error) <= deviations * result.estimate.std))


def headline(result: IdentificationResult) -> str:
    """The result in one or two sentences."""
    fit, validation = torque_error(result.fits), torque_error(result.validations)
    parts = []
    if validation is not None:
        parts.append(
            f"Torque on runs that were not fitted is predicted to {_percent(validation.overall)} of its RMS"
        )
        if fit is not None:
            parts[-1] += f" ({_percent(fit.overall)} on the fitted ones)"
    elif fit is not None:
        parts.append(
            f"Torque on the fitted runs is reproduced to {_percent(fit.overall)} of its RMS; no run was left"
            " out to validate it"
        )
    ratio, inside = noise_ratio(result), within(result, 2)
    if ratio is not None:
        where = "at the noise floor" if ratio <= AT_NOISE_FLOOR else "above the noise floor"
        parts[-1] += f", {where}: {ratio:.2f} times what sensor noise alone leaves"
    count = result.estimate.base.count
    if inside is not None:
        parts.append(f"{inside} of {count} base parameters lie within two standard deviations of the truth")
    else:
        known = int(np.sum(result.estimate.percent_sigma < 10))
        parts.append(
            f"{known} of {count} base parameters are known to better than 10 % (one standard deviation)"
        )
    if result.mended:
        parts.append(f"{result.mended} samples of the logs were held or spoiled, and are interpolated")
    return ". ".join(parts) + "."


def torque_unit(result: IdentificationResult) -> str:
    """N·m, N, or both where the robot has hinge and slide joints."""
    units = sorted(set(result.robot.units()), reverse=True)
    return units[0] if len(units) == 1 else "N·m (N for a slide joint)"


def significant(value: float | None, digits: int = 4) -> str:
    """A number with that many significant digits, or a dash where there is none."""
    if value is None or value != value:
        return "–"
    text = f"{value:.{digits}g}"
    return f"{value:.0f}" if "e+" in text and abs(value) < LONGEST_INTEGER else text


def _percent(ratio: float) -> str:
    return f"{100 * ratio:.3g} %"
