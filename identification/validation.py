"""How well an estimate predicts torque along a run."""

import numpy as np

from .estimate import Estimate, TorqueFit
from .observations import Observations


def torque_fit(estimate: Estimate, run: Observations) -> TorqueFit:
    """Measured against predicted torque of one run; a joint that never leaves rest has NaN errors."""
    predicted = run.regressor @ estimate.values
    residual = np.where(run.used, run.torque - predicted, 0.0)
    torque = np.where(run.used, run.torque, 0.0)
    counts = run.used.sum(axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        rms = np.sqrt(np.sum(residual**2, axis=0) / counts)
        relative = rms / np.sqrt(np.sum(torque**2, axis=0) / counts)
    return TorqueFit(run.name, run.time, run.q, run.dq, run.torque, predicted, run.used, rms, relative)
