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
from dataclasses import dataclass, replace

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
    effects' change of what is left then. parameters_at_rest, effects_at_rest: (n,) the same near rest, where
    friction is of no known size. parameters_whole, effects_whole: the same for all joints and samples at
    once, as one set of parameters must have it.
    """

    parameters: Array
    effects: Array
    parameters_at_rest: Array
    effects_at_rest: Array
    parameters_whole: float
    effects_whole: float

    def of_torque(
        self, nominal: Array, parameters: Array, effects: Array, at_rest: Mask | None = None
    ) -> tuple[Array, Array]:
        """Torque, or residual, (N, n) re-identified and with the effects, as far as they are kept.

        at_rest: (N, n), the samples near rest; None for none of them.
        """
        first_share, second_share = self.parameters, self.effects
        if at_rest is not None:
            first_share = np.where(at_rest, self.parameters_at_rest, first_share)
            second_share = np.where(at_rest, self.effects_at_rest, second_share)
        first = nominal + first_share * (parameters - nominal)
        return first, first + second_share * (effects - first)

    def without_effects(self, joints: Mask) -> "Kept":
        """The same with nothing kept of the effects' change at some joints (n,)."""
        moving, at_rest = (np.where(joints, 0.0, each) for each in (self.effects, self.effects_at_rest))
        whole = self.effects_whole * float(moving.any() or at_rest.any())
        return replace(self, effects=moving, effects_at_rest=at_rest, effects_whole=whole)


def everything(joints: int) -> Kept:
    """All of what was fitted."""
    all_of_it = np.ones(joints)
    return Kept(all_of_it, all_of_it, all_of_it, all_of_it, parameters_whole=1.0, effects_whole=1.0)


def shares_kept(
    left_out: Sequence[Sequence[Array]], at_rest: Sequence[Sequence[Array]], weights: Array
) -> tuple[Kept, Mask]:
    """Shares to keep, and the joints (n,) that effects predict better at all while they move, however surely.

    By residuals of samples that were not fitted: (M, n) a run, zero where none counts. left_out: by the model
    as given, re-identified, and with the effects, of runs that were left out, whose errors are never made
    larger. at_rest: the same near rest, where nothing is fitted. weights: (n,) of the joints' squared
    residuals against each other. A joint of which no sample counts keeps nothing. Near rest the share is that
    of moving joints, as far as it makes nothing worse there.
    """
    given, parameters, effects = left_out
    first, _ = _sure_share(*_sums(given, parameters))
    second, best = _sure_share(*_sums(_moved(given, parameters, first), effects))
    resting, parameters_at_rest, effects_at_rest = at_rest
    first_at_rest = _harmless(first, resting, parameters_at_rest)
    moved = _moved(resting, parameters_at_rest, first_at_rest)
    second_at_rest = _harmless(second, moved, effects_at_rest)
    stages = [[list(run) for run in zip(*each, strict=True)] for each in zip(left_out, at_rest, strict=True)]
    nominal, fitted, final = ([np.stack(run) for run in stage] for stage in stages)
    whole = _whole_share(nominal, fitted, weights)
    of_both = _whole_share(_moved(nominal, fitted, np.array(whole)), final, weights)
    return Kept(first, second, first_at_rest, second_at_rest, whole, of_both), best > 1 - ALL


def _harmless(share: Array, before: Sequence[Array], after: Sequence[Array]) -> Array:
    """The share (n,) of a change, or less where these residuals (M, n) of each run would be larger for it."""
    gain, power = (each.sum(axis=0) for each in _sums(before, after))
    # The error is back where it was at twice the best share.
    most = np.divide(2 * gain, power, out=np.ones_like(share), where=power > 0)
    return np.clip(np.minimum(share, most), 0.0, 1.0)


def _moved(before: Sequence[Array], after: Sequence[Array], share: Array) -> list[Array]:
    return [a + share * (b - a) for a, b in zip(before, after, strict=True)]


def _sums(before: Sequence[Array], after: Sequence[Array]) -> tuple[Array, Array]:
    """Sums of before · change and of change² over the samples of each piece of the runs, (pieces, ..., n).

    before, after: residuals (..., M, n) of each run.
    """
    cuts = -(-PIECES // len(before))
    gained, sizes = [], []
    for one, other in zip(before, after, strict=True):
        for piece, changed in zip(
            np.array_split(one, cuts, axis=-2), np.array_split(one - other, cuts, axis=-2), strict=True
        ):
            gained.append(np.einsum("...tj,...tj->...j", changed, piece))
            sizes.append(np.einsum("...tj,...tj->...j", changed, changed))
    return np.array(gained), np.array(sizes)


def _whole_share(before: Sequence[Array], after: Sequence[Array], weights: Array) -> float:
    """One share of the change of all joints, between residuals (2, M, n) of each run: moving, near rest."""
    gain, power = (np.sum(weights * each, axis=2) for each in _sums(before, after))
    # What rest leaves is of no model, and says little of how sure the share is.
    moving, _ = _sure_share(gain[:, :1], power[:, :1])
    best = gain.sum() / max(float(power.sum()), float(np.finfo(float).tiny))
    # The error on runs left out is back where it was at twice its own best share.
    return float(np.clip(min(moving[0], 2 * best), 0.0, 1.0))


def _sure_share(gain: Array, power: Array) -> tuple[Array, Array]:
    """The share (n,) to keep, and that of the least squared error. gain, power: (pieces, n) of ``_sums``."""
    size = np.maximum(power.sum(axis=0), np.finfo(float).tiny)
    best = gain.sum(axis=0) / size
    # Of a ratio of sums, by pieces that differ (Cochran, "Sampling Techniques", 1977, section 6.3).
    pieces = len(gain)
    error = np.sqrt(pieces / (pieces - 1) * np.sum((gain - best * power) ** 2, axis=0)) / size
    doubt = np.divide(error, best, out=np.ones_like(best), where=best > error)
    sure = best * (1 - doubt**2)
    share = np.where(sure >= ALL, 1.0, np.where(sure <= 1 - ALL, 0.0, sure))
    # The error is back where it was at twice the best share.
    return np.asarray(np.clip(np.minimum(share, 2 * best), 0.0, 1.0)), best
