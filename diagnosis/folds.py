"""What is left out in turn: whole runs, but of what no other run tells, parts of it."""

from dataclasses import replace

import numpy as np

from .evidence import fitted_to, is_extrapolated, squares
from .ground import ground
from .preparation import Prepared, blocks

# A run is extrapolated to where that leaves no less than this share of the joint's torque.
SEEN = 0.01
# Then it is left out in so many parts, by the number of runs: all folds together are what a fit costs.
PARTS = {1: 12, 2: 6} | dict.fromkeys(range(3, 7), 3)
PARTS_OF_MANY = 2


def covered(prepared: Prepared) -> Prepared:
    """The runs with folds that the others foretell: joints may move in turn, or in one run alone be fast."""
    hypothesis, fitted = fitted_to(prepared, [])
    torque = ground(prepared).torque_rms
    parts = PARTS.get(len(prepared.runs), PARTS_OF_MANY)
    folds: list[tuple[int, slice]] = []
    for index, run in enumerate(prepared.runs):
        own = [part for at, part in prepared.folds if at == index]
        least = (SEEN * torque) ** 2 * np.maximum(hypothesis.used[index].sum(axis=0), 1)
        without, together = squares([fitted.held_out[index]]), squares([fitted.residual[index]])
        is_alone = np.any(is_extrapolated(together, without) & (without > least))
        if is_alone and len(own) < parts:
            own = blocks(len(run.time), parts)
        folds.extend((index, part) for part in own)
    return replace(prepared, folds=tuple(folds))
