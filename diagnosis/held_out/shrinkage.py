"""Shares to which fitted changes are shrunk, so that they never predict left-out runs worse than before.

The torque of a model moves from the one before it by a share s of the whole change, 0 to 1, the one of the
smallest squared error on runs that were left out:

    s = <before, before - after> / |before - after|²

of the residuals of both. With s = 0 the error is as before, so it is never larger (a James-Stein kind of
shrinkage, its factor by cross-validation: Breiman, "Stacked regressions", Machine Learning 24, 1996).
A share that differs from run to run is itself only known to a standard error e, and what some runs speak for
and others against would make the next one worse: s (1 - e²/s²) is kept, nothing where e > s (the
positive-part James-Stein estimate of a mean: Efron and Morris, JASA 68, 1973).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

# From this share on all is kept, and up to 1 - ALL nothing: that costs a hundredth of what is gained.
ALL = 0.9
# Pieces of runs at least, by which a share's standard error is known; fewer runs are cut in time.
PIECES = 4


@dataclass(frozen=True)
class Kept:
    """Shares, 0 to 1, of what was fitted that is kept.

    parameters: (n,) of re-identification's change of the given model's torque, a joint. effects: (n,) of the
    effects' change of what is left then. parameters_whole, effects_whole: the same for all joints at once, as
    one set of parameters must have it.
    """

    parameters: Array
    effects: Array
    parameters_whole: float
    effects_whole: float

    def of_torque(self, nominal: Array, parameters: Array, effects: Array) -> tuple[Array, Array]:
        """Torque, or residual, (N, n) re-identified and with the effects, as far as they are kept."""
        first = nominal + self.parameters * (parameters - nominal)
        return first, first + self.effects * (effects - first)


def everything(joints: int) -> Kept:
    """All of what was fitted."""
    return Kept(np.ones(joints), np.ones(joints), 1.0, 1.0)


def shares_kept(
    left_out: Sequence[Sequence[Array]], at_rest: Sequence[Sequence[Array]], weights: Array
) -> tuple[Kept, Mask]:
    """Shares to keep, and the joints (n,) that effects predict better at all, however surely.

    By residuals of samples that were not fitted: (M, n) a run, zero where none counts. left_out: by the model
    as given, re-identified, and with the effects, of runs that were left out, whose errors are never made
    larger. at_rest: the same near rest, where nothing is fitted. weights: (n,) of the joints' squared
    residuals against each other. A joint of which no sample counts keeps nothing.
    """
    stages = [[list(run) for run in zip(*each, strict=True)] for each in zip(left_out, at_rest, strict=True)]
    given, first, second = ([np.stack(run) for run in stage] for stage in stages)
    of_first, _ = _share(given, first, np.ones(len(weights)))
    of_second, best = _share(_moved(given, first, of_first), second, np.ones(len(weights)))
    whole, _ = _share(given, first, weights, together=True)
    of_both, _ = _share(_moved(given, first, whole), second, weights, together=True)
    return Kept(of_first, of_second, float(whole[0]), float(of_both[0])), best > 1 - ALL


def _moved(before: list[Array], after: list[Array], share: Array) -> list[Array]:
    return [a + share * (b - a) for a, b in zip(before, after, strict=True)]


def _share(
    before: list[Array], after: list[Array], weights: Array, together: bool = False
) -> tuple[Array, Array]:
    """Shares (n,) of the change between residuals (2, M, n) of each run; those of the least squared error.

    together: one of all joints.
    """
    cuts = -(-PIECES // len(before))
    gained, sizes = [], []
    for one, other in zip(before, after, strict=True):
        for piece, changed in zip(
            np.array_split(one, cuts, axis=1), np.array_split(one - other, cuts, axis=1), strict=True
        ):
            gained.append(weights * np.einsum("stj,stj->sj", changed, piece))
            sizes.append(weights * np.einsum("stj,stj->sj", changed, changed))
    # Sums over the samples of each piece, kind and joint, (pieces, 2, n).
    gain, power = np.array(gained), np.array(sizes)
    if together:
        gain, power = (np.repeat(each.sum(axis=2, keepdims=True), len(weights), 2) for each in (gain, power))
    tiny = np.finfo(float).tiny
    best = gain.sum(axis=(0, 1)) / np.maximum(power.sum(axis=(0, 1)), tiny)
    # Of samples that move alone: what rest leaves is of no model, and says little of the share.
    gain, power = gain[:, 0], power[:, 0]
    size = np.maximum(power.sum(axis=0), tiny)
    moving = gain.sum(axis=0) / size
    # Of a ratio of sums, by pieces that differ (Cochran, "Sampling Techniques", 1977, section 6.3).
    pieces = len(gain)
    error = np.sqrt(pieces / (pieces - 1) * np.sum((gain - moving * power) ** 2, axis=0)) / size
    doubt = np.divide(error, moving, out=np.ones_like(best), where=moving > error)
    sure = best * (1 - doubt**2)
    # The error on runs left out is back where it was at twice its own best share.
    most = 2 * moving
    share = np.where(sure >= ALL, 1.0, np.where(sure <= 1 - ALL, 0.0, sure))
    return np.asarray(np.clip(np.minimum(share, most), 0.0, 1.0)), np.minimum(best, most)
