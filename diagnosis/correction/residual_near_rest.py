"""Residuals of the models at samples near rest, which no fit uses but predictions include."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from identification.springs import spring_torque

from ..data.preparation import Prepared
from .corrected_model import Corrected
from .prediction import as_predicted, torque_along

Array = NDArray[np.float64]


def left_at_rest(prepared: Prepared, model: Corrected) -> tuple[tuple[Array, ...], ...]:
    """Residuals of samples near rest, a run (M, n) N·m, zero elsewhere: as given, re-identified, corrected.

    Only of joints that move in the run: of one that stands still nothing is kept.
    """
    each_run = [_of_run(prepared, index, model) for index in range(len(prepared.runs))]
    given, parameters, corrected = zip(*each_run, strict=True)
    return given, parameters, corrected


def _of_run(prepared: Prepared, index: int, model: Corrected) -> Sequence[Array]:
    run = prepared.runs[index]
    logged = as_predicted(model, run.logged)
    near_rest = run.whole & ~run.used & prepared.moved[index]
    joints, springs = range(prepared.joints), spring_torque(prepared.robot.chain.springs, run.logged.q)
    return [
        np.where(near_rest, run.torque - run.filtered(torque - springs, joints), 0.0)
        for torque in torque_along(model, logged)
    ]
