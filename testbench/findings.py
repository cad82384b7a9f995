"""The figures that the summary, the page, the session and estimate.json all quote."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identification.estimate import TorqueFit
from identification.parameters import standard_parameters

from .results import IdentificationResult
from .robot import Robot

Array = NDArray[np.float64]

# A validation error up to this many times the noise floor is called "at the noise floor"; one up to so many
# times the fit's, in N·m, is no larger.
AT_NOISE_FLOOR = 1.2
# A validation error this many times the fit's says that the runs determine too little.
OVERFIT = 1.5
# A change scaled by less than this is said to be.
WHOLE = 0.995
# Larger numbers are written with an exponent.
LONGEST_INTEGER = 1e6


@dataclass(frozen=True)
class TorqueError:
    """Torque error of several runs taken together, over the samples that count.

    rms: (n,) N·m (N), NaN for a joint that never leaves rest. relative: (n,) residual RMS over torque
    RMS. overall: residual RMS over torque RMS with all joints pooled. unfiltered: (n,) N·m (N), RMS of the
    torque as logged, above the joint's cut-off too, less the prediction.
    """

    rms: Array
    relative: Array
    overall: float
    unfiltered: Array


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
        counts = np.array([fit.used.sum(axis=0) for fit in fits])
        squares = np.where(counts > 0, counts * np.array([fit.rms_unfiltered for fit in fits]) ** 2, 0.0)
        unfiltered = np.sqrt(squares.sum(axis=0) / counts.sum(axis=0))
    return TorqueError(rms, relative, overall, unfiltered)


def parameter_rows(result: IdentificationResult) -> tuple[ParameterRow, ...]:
    """One row a base parameter, in the order of the estimate."""
    estimate, comparison = result.estimate, result.comparison
    standard = standard_parameters(result.robot.chain.link_slides)
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


def _predicts_far_worse(fit: TorqueError, validation: TorqueError) -> bool:
    """Whether the error on other runs is far larger, and so not only because these have less torque."""
    known = np.isfinite(fit.rms) & np.isfinite(validation.rms)
    larger = np.linalg.norm(validation.rms[known]) > AT_NOISE_FLOOR * np.linalg.norm(fit.rms[known])
    return bool(larger) and validation.overall > OVERFIT * fit.overall


def headline(result: IdentificationResult) -> str:
    """The result in one or two sentences."""
    fit, validation = torque_error(result.fits), torque_error(result.validations)
    count = len(result.fits)
    given = torque_error(result.given[count:] or result.given[:count])
    parts = []
    if fit is not None and validation is not None and _predicts_far_worse(fit, validation):
        parts.append(
            "These runs determine too little: the fit is far better than what it predicts of other runs"
        )
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
    if given is not None and parts:
        parts[-1] += f"; by the model as given, to {_percent(given.overall)}"
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


def left_open(result: IdentificationResult) -> tuple[str, ...]:
    """Sentences on what these runs leave open, how far the estimate goes, and up to what frequency."""
    found, names = [], result.robot.joint_names
    if result.determination is not None:
        known, count = result.determination.directions, result.estimate.base.count
        if known < count:
            found.append(
                f"These runs determine {known} of {count} independent combinations of the base parameters;"
                " the rest is held near the model as given"
            )
        found += result.determination.remarks
    if result.shrinkage is not None and result.shrinkage.factor == 0:
        found.append(
            "Nothing that was fitted predicts left-out parts of these runs better than the model as given:"
            " its parameters are kept"
        )
    elif result.shrinkage is not None and result.shrinkage.factor < WHOLE:
        found.append(
            f"Left-out parts of these runs are predicted best with {_percent(result.shrinkage.factor)} of the"
            " change that fits them"
        )
    if result.bands is not None:
        narrow = result.bands.cutoff < result.bands.cutoff.max()
        if narrow.any():
            bands = ", ".join(
                f"{names[j]} {result.bands.cutoff[j]:.3g} Hz" for j in np.flatnonzero(narrow).tolist()
            )
            found.append(
                f"Above these frequencies encoder noise would pass for torque, nothing is fitted: {bands}"
            )
    return tuple(f"{each}." for each in found)


def torque_unit(robot: Robot) -> str:
    """N·m, N, or both where the robot has hinge and slide joints."""
    units = sorted(set(robot.units()), reverse=True)
    return units[0] if len(units) == 1 else "N·m (N for a slide joint)"


def significant(value: float | None, digits: int = 4) -> str:
    """A number with that many significant digits, or a dash where there is none."""
    if value is None or value != value:
        return "–"
    text = f"{value:.{digits}g}"
    return f"{value:.0f}" if "e+" in text and abs(value) < LONGEST_INTEGER else text


def _percent(ratio: float) -> str:
    return f"{100 * ratio:.3g} %"
