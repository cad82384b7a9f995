"""What an identification found."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .base_parameters import BaseParameters

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Estimate:
    """Base parameters with an honest covariance.

    base: which combinations of standard parameters these are (names, units, the map both ways).
    values: (b,). covariance: (b, b), with coloured residuals allowed for.
    noise_std: (n,) N·m, residual standard deviation a joint of the filtered fit.
    condition_number: of the stacked regressor, columns scaled to unit norm.
    effective_samples: independent residual samples, over all joints.
    estimator: its name.
    standard: (14 n,) a full standard vector with these base values, where the estimator finds one.
    exogeneity_p_value: of the test that the measured regressor is free of errors that matter (below .05 least
    squares is biased), where the estimator makes it.
    """

    base: BaseParameters
    values: Array
    covariance: Array
    noise_std: Array
    condition_number: float
    effective_samples: float
    estimator: str
    standard: Array | None = None
    exogeneity_p_value: float | None = None

    @property
    def std(self) -> Array:
        """Standard deviations, (b,)."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def percent_sigma(self) -> Array:
        """Relative standard deviations 100 std / |value|, (b,), %; inf for a value of zero."""
        with np.errstate(divide="ignore", over="ignore"):
            return 100 * self.std / np.abs(self.values)


@dataclass(frozen=True)
class TorqueFit:
    """How well an estimate predicts one run's torque, on the filtered, decimated grid of M samples.

    name: the run's. time: (M,) s. measured, predicted: (M, n) N·m. used: (M, n) bool, samples that
    count (outside the dead zone near rest). rms: (n,) residual RMS over used samples.
    relative: (n,) residual RMS over torque RMS, same samples. q, dq: (M, n) filtered motion.
    rms_unfiltered: (n,) N·m, RMS of the torque as logged less the prediction, which ends at the cut-off.
    """

    name: str
    time: Array
    q: Array
    dq: Array
    measured: Array
    predicted: Array
    used: NDArray[np.bool_]
    rms: Array
    relative: Array
    rms_unfiltered: Array

    @property
    def overall_relative(self) -> float:
        """Residual RMS over torque RMS with all joints pooled."""
        residual = np.where(self.used, self.measured - self.predicted, 0.0)
        torque = np.where(self.used, self.measured, 0.0)
        return float(np.linalg.norm(residual) / np.linalg.norm(torque))
