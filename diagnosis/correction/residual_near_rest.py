"""Residuals of the models at samples near rest, which no fit uses but predictions include."""

import numpy as np
from numpy.typing import NDArray

from ..data.run import Prepared
from .correction_document import Corrected
from .prediction import as_predicted, torque_along

Array = NDArray[np.float64]


def left_at_rest(prepared: Prepared, model: Corrected) -> tuple[tuple[Array, ...], ...]:
    """Residuals of samples near rest, a run (M, n) N·m, zero elsewhere: as given, re-identified, corrected.

    Only of joints that move in the run: of one that stands still nothing is kept.
    """
    each_run = []
    for run, moved in zip(prepared.runs, prepared.moved, strict=True):
        near_rest = run.whole & ~run.used & moved
        torques = torque_along(model, as_predicted(model, run.logged))
        each_run.append([np.where(near_rest, run.left_by(torque), 0.0) for torque in torques])
    given, parameters, corrected = zip(*each_run, strict=True)
    return given, parameters, corrected
