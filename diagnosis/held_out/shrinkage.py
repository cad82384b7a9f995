"""How much of what was fitted is kept, so that runs that were left out are never predicted worse without it.

The torque of a model moves from the one before it by a share s of the whole change, 0 to 1, the one of the
smallest squared error on runs that were left out:

    s = <before, before - after> / |before - after|²

of the residuals of both. With s = 0 the error is as before, so it is never larger (a James-Stein kind of
shrinkage, its factor by cross-validation: Breiman, "Stacked regressions", Machine Learning 24, 1996).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# From this share on all is kept, and up to the rest of it nothing: that costs a hundredth of what is gained.
ALL = 0.9


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
) -> Kept:
    """Shares to keep, by residuals of samples that were not fitted: (M, n) a run, zero where none counts.

    left_out: by the model as given, re-identified, and with the effects, of runs that were left out, whose
    errors are never made larger. at_rest: the same near rest, where nothing is fitted. weights: (n,) of the
    joints' squared residuals against each other. A joint of which no sample counts keeps nothing.
    """
    given, first, second = (_both(*each) for each in zip(left_out, at_rest, strict=True))
    of_first = _share(given, first, np.ones(len(weights)))
    shrunk = given + of_first * (first - given)
    of_second = _share(shrunk, second, np.ones(len(weights)))
    whole = _share(given, first, weights, together=True)
    shrunk = given + whole * (first - given)
    return Kept(
        of_first, of_second, float(whole[0]), float(_share(shrunk, second, weights, together=True)[0])
    )


def _both(left_out: Sequence[Array], at_rest: Sequence[Array]) -> Array:
    """Residuals of all runs, of those left out and of those near rest, (2, N, n)."""
    return np.stack([np.concatenate(left_out), np.concatenate(at_rest)])


def _share(before: Array, after: Array, weights: Array, together: bool = False) -> Array:
    """Shares (n,) of the change between residuals (2, N, n). together: one of all joints."""
    change = before - after
    # Sums over the samples of each kind and joint, (2, n).
    gained, size = (weights * np.einsum("stj,stj->sj", change, each) for each in (before, change))
    if together:
        gained, size = (
            np.repeat(each.sum(axis=1, keepdims=True), len(weights), 1) for each in (gained, size)
        )
    tiny = np.finfo(float).tiny
    best = gained.sum(axis=0) / np.maximum(size.sum(axis=0), tiny)
    # The error is back where it was at twice its own best share.
    most = np.where(size[0] > 0, 2 * gained[0] / np.maximum(size[0], tiny), 0.0)
    share = np.where(best >= ALL, 1.0, np.where(best <= 1 - ALL, 0.0, best))
    return np.asarray(np.clip(np.minimum(share, most), 0.0, 1.0))
