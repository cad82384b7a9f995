"""Folds for cross-validation: whole runs, or parts of a run that the other runs do not determine."""

from collections.abc import Collection
from dataclasses import replace

import numpy as np

from ..data.preparation import FEWEST_FOLDS, blocks
from ..data.run import Prepared
from ..fit.likelihood import gained
from ..fit.normal_equations import fitted_to, is_extrapolated, squares
from ..fit.score import Stage
from ..model.base_regressor import BaseRegressor
from ..model.effect_sizes import SMALLEST_TORQUE
from ..model.gram import Bank

# A single run is left out in so many parts, each of two in half as many: all folds are what a fit costs.
PARTS = 12
# An effect that gains this log-likelihood in one run, which is this share of all that it gains, and that the
# others hardly predict: less than this share of it.
SHOWN, OF_ONE, PREDICTED = 30.0, 0.9, 0.5


def covered(prepared: Prepared) -> Prepared:
    """The runs with folds that the others predict: joints may move in turn, or in one run alone be fast."""
    hypothesis, fitted = fitted_to(BaseRegressor(prepared), [])
    torque = hypothesis.base.torque_rms
    # A joint that moves in one run only is not identifiable from the others.
    alone: set[int] = set()
    if len(prepared.runs) > 1:
        alone.update(np.flatnonzero(np.any(prepared.moved_alone, axis=1)).tolist())
    for index in range(len(prepared.runs)):
        least = (SMALLEST_TORQUE * torque) ** 2 * np.maximum(hypothesis.used[index].sum(axis=0), 1)
        without, together = squares([fitted.held_out[index]]), squares([fitted.residual[index]])
        if np.any(is_extrapolated(together, without) & (without > least)):
            alone.add(index)
    return _in_parts(prepared, alone)


def covered_for(stage: Stage, bank: Bank) -> Prepared:
    """The runs with folds that predict effects of the bank, too: only one run may show a backlash."""
    prepared = stage.prepared
    runs = np.array([run for run, _ in prepared.folds])
    gains, alone = stage.gains(bank), set()
    for members, own_squares in zip(bank.groups, bank.squares, strict=True):
        for index, squared in zip(members, own_squares, strict=True):
            gain = gains[index]
            if gain is None or gain.objective < 2 * SHOWN:
                continue
            done = np.einsum("j,a,fjab,b->f", stage.weights, gain.coefficients, squared, gain.coefficients)
            of_runs = np.bincount(runs, done)
            if of_runs.max() > OF_ONE * done.sum() and gained(stage, gain) < PREDICTED * gain.objective / 2:
                alone.add(int(of_runs.argmax()))
    return _in_parts(prepared, alone)


def _in_parts(prepared: Prepared, alone: Collection[int]) -> Prepared:
    """The runs with some of them left out in parts; unchanged where none of those is left out as a whole."""
    parts = max(PARTS // 2 ** (len(prepared.runs) - 1), FEWEST_FOLDS)
    folds: list[tuple[int, slice]] = []
    for index, run in enumerate(prepared.runs):
        own = [part for at, part in prepared.folds if at == index]
        if index in alone and len(own) < parts:
            own = blocks(len(run.time), parts)
        folds.extend((index, part) for part in own)
    return prepared if len(folds) == len(prepared.folds) else replace(prepared, folds=tuple(folds))
