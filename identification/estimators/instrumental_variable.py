"""Instrumental variables: consistent however noisy the measured regressor is.

Janot, Vandanjon & Gautier (2014), "A generic instrumental variable approach for industrial robot
identification", IEEE TCST 22(1): beta = (Z'W)^-1 Z'tau, with Z the regressor along the motion that
is simulated with the current estimate, which the encoder noise in W has nothing to do with.

The Durbin-Wu-Hausman test asks whether least squares would have done: the part of W that Z does not
explain is added to the regression, and if it explains torque W is correlated with the errors
(Janot, Vandanjon & Gautier 2016, "A revised Durbin-Wu-Hausman test for industrial robot identification").
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc

from ..estimate import Estimate
from ..observations import Observations
from ..problem import Problem
from ..simulated_motion import (
    require_torque_equations,
    simulatable,
    simulate_values,
    simulated_equations,
)
from . import wls

Array = NDArray[np.float64]

PASSES = 3
# Stop when no parameter moves by more than this share of its deviation, or of its value.
TOLERANCE, RELATIVE_TOLERANCE = 0.1, 1e-4
# Directions of W outside Z smaller than this share of W are rounding.
SMALLEST_SHARE = 1e-7


@dataclass(frozen=True)
class ExogeneityTest:
    """Whether the measured regressor is free of errors that matter: if not, least squares is biased.

    statistic: chi-squared with ``degrees`` degrees of freedom if it is. p_value: of that.
    """

    statistic: float
    degrees: int
    p_value: float


@dataclass(frozen=True)
class Rows:
    """Rows of all runs, times their weights. measured: W (K, b). instruments: Z (K, b). torque: (K,)."""

    measured: Array
    instruments: Array
    torque: Array


def estimate(problem: Problem) -> Estimate:
    """beta = (Z'S^-1 W)^-1 Z'S^-1 tau, S the diagonal of joint residual variances, until it settles.

    Starts from the weighted fit. ``exogeneity_p_value`` is that of the Durbin-Wu-Hausman test. Raises
    InputError when the logs tell no reference or controller, and for other models than the inverse
    dynamic.
    """
    require_torque_equations(problem, "instrumental_variable")
    found = wls.estimate(problem)
    for _ in range(PASSES):
        (simulated,) = simulate_values(problem, simulatable(problem, found.values)[None])
        instruments = simulated_equations(problem, simulated)
        weights = problem.residual_weights(found.values)
        rows = _rows(problem, instruments, weights)
        before, found = found, _estimate(problem, rows, weights)
        moved = np.abs(found.values - before.values)
        if np.all(moved <= np.maximum(TOLERANCE * found.std, RELATIVE_TOLERANCE * np.abs(found.values))):
            break
    return replace(found, exogeneity_p_value=durbin_wu_hausman(rows).p_value)


def durbin_wu_hausman(rows: Rows) -> ExogeneityTest:
    """Test of the rows' measured regressor by the excess that its part outside Z explains, beside itself.

    Rows are divided by their deviation, so the excess in the sum of squares is chi-squared.
    """
    outside = _outside(rows.instruments, rows.measured)
    outside = _outside(rows.measured, outside) / np.linalg.norm(rows.measured, axis=0)
    left, sizes, _ = np.linalg.svd(outside, full_matrices=False)
    directions = left[:, sizes > SMALLEST_SHARE]
    residual = _outside(rows.measured, rows.torque[:, None])[:, 0]
    statistic = float(np.sum((directions.T @ residual) ** 2))
    degrees = directions.shape[1]
    p_value = float(chdtrc(degrees, statistic)) if degrees else 1.0
    return ExogeneityTest(statistic, degrees, p_value)


def _rows(problem: Problem, instruments: Sequence[Observations], weights: Array) -> Rows:
    """The rows that count, times their equation's weight."""
    measured, simulated, torque = [], [], []
    for run, other in zip(problem.observations, instruments, strict=True):
        scale = weights[np.nonzero(run.used)[1]]
        measured.append(run.regressor[run.used] * scale[:, None])
        simulated.append(other.regressor[run.used] * scale[:, None])
        torque.append(run.torque[run.used] * scale)
    return Rows(np.concatenate(measured), np.concatenate(simulated), np.concatenate(torque))


def _estimate(problem: Problem, rows: Rows, weights: Array) -> Estimate:
    """The estimate with covariance (Z'W)^-1 Z'Z (W'Z)^-1 (Söderström & Stoica 1989, section 8.2)."""
    scale, own = (np.linalg.norm(matrix, axis=0) for matrix in (rows.measured, rows.instruments))
    instruments = rows.instruments / own
    product = instruments.T @ (rows.measured / scale)
    values = np.linalg.solve(product, instruments.T @ rows.torque) / scale
    spread = np.linalg.inv(product) / scale[:, None]
    freedom = len(rows.torque) / max(1.0, len(rows.torque) - problem.base.count)
    # The weights come from the estimate before; what is left of them is the residuals' variance now.
    std, inflation = problem.residual_std(values)
    counts = problem.counts
    variance = float(np.sum(counts * weights**2 * std**2 * inflation) / counts.sum())
    covariance = freedom * variance * spread @ (instruments.T @ instruments) @ spread.T
    found = problem.linear_estimate(values, weights, "instrumental_variable")
    return replace(found, covariance=0.5 * (covariance + covariance.T))


def _outside(basis: Array, columns: Array) -> Array:
    """The columns less their projection on the span of the basis."""
    orthonormal, _ = np.linalg.qr(basis / np.linalg.norm(basis, axis=0))
    return columns - orthonormal @ (orthonormal.T @ columns)
