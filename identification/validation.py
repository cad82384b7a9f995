"""How well base parameters predict torque along a run."""

import numpy as np
from numpy.typing import NDArray

from .estimate import TorqueFit
from .observations import Observations
from .signals import Motion


def torque_fit(values: NDArray[np.float64], run: Observations, raw: Motion) -> TorqueFit:
    """Measured against predicted torque of one run; a joint that never leaves rest has NaN errors.

    values: (b,) base parameters. raw: the run before filtering, springs' torque taken off.
    """
    predicted = run.regressor @ values
    instants = np.round(run.time * raw.sample_rate).astype(int)
    unfiltered = np.where(run.used, raw.torque[instants] - predicted, 0.0)
    residual = np.where(run.used, run.torque - predicted, 0.0)
    torque = np.where(run.used, run.torque, 0.0)
    counts = run.used.sum(axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        rms = np.sqrt(np.sum(residual**2, axis=0) / counts)
        relative = rms / np.sqrt(np.sum(torque**2, axis=0) / counts)
        rms_unfiltered = np.sqrt(np.sum(unfiltered**2, axis=0) / counts)
    return TorqueFit(
        name=run.name,
        time=run.time,
        q=run.q,
        dq=run.dq,
        measured=run.torque,
        predicted=predicted,
        used=run.used,
        rms=rms,
        relative=relative,
        rms_unfiltered=rms_unfiltered,
    )
