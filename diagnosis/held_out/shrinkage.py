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
    nominal: Sequence[Array], parameters: Sequence[Array], effects: Sequence[Array], weights: Array
) -> Kept:
    """What to keep by residuals of runs that were left out, a run (M, n) each, zero where none counts.

    nominal, parameters, effects: of the model as given, re-identified, and with the effects. weights: (n,) of
    the joints' squared residuals against each other. A joint of which no sample counts keeps nothing.
    """
    given, first, second = (np.concatenate(each) for each in (nominal, parameters, effects))
    of_first = _share(_dot(given, given - first), _dot(given - first, given - first))
    shrunk = given + of_first * (first - given)
    of_second = _share(_dot(shrunk, shrunk - second), _dot(shrunk - second, shrunk - second))
    whole = _whole(given, first, weights)
    together = given + whole * (first - given)
    return Kept(of_first, of_second, whole, _whole(together, second, weights))


def _whole(before: Array, after: Array, weights: Array) -> float:
    change = before - after
    return float(_share(weights @ _dot(before, change), weights @ _dot(change, change)))


def _dot(one: Array, other: Array) -> Array:
    """Sums of products over the samples (N, n), (n,)."""
    return np.asarray(np.einsum("tj,tj->j", one, other))


def _share(gained: Array, size: Array) -> Array:
    share = np.clip(gained / np.maximum(size, np.finfo(float).tiny), 0.0, 1.0)
    share = np.where(share >= ALL, 1.0, np.where(share <= 1 - ALL, 0.0, share))
    return np.where(size > 0, share, 0.0)
