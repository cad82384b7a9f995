"""The evidence of runs for a limb in order, for one with a fault, and for something unknown.

The likelihood of a joint's position is that of N/f independent errors of unknown deviation s, s^(-N/f), with
one inflation f by autocorrelation for all hypotheses: that of the best. Unknowns are integrated out by
Laplace's method. A fault's size is log-uniform between what its effect states, that of a joint in order
half-normal.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identification.output_error.fit import Fit

from .hypothesis import Place
from .sizes import Sizes

Array = NDArray[np.float64]

# Odds before the runs are looked at, against a limb in order: a fault of the catalogue, another one.
FAULT, OTHER = 0.8, 0.2
# Something unknown leaves this share of a joint's position error, for so many unknowns: an effect there that
# explains less of it is no explanation.
OTHER_LEAVES, OTHER_UNKNOWNS = 0.7, 6
# Of an effect's largest size: beyond, it is held by that bound.
INSIDE = 0.99


# Hypotheses are the same only where they are one fit: their arrays have no single equality.
@dataclass(frozen=True, eq=False)
class Fitted:
    """A hypothesis fitted. place: None for the limb as it was before. size: in the effect's scale, and its
    deviation."""

    place: Place | None
    fit: Fit
    size: float = 0.0
    size_std: float = 0.0


@dataclass(frozen=True, eq=False)
class Weighed:
    """A fitted hypothesis, its probability, and the log of its Bayes factor against the limb in order.

    spared: log-likelihood of the parameters' shift from what is stated that it spares.
    """

    fitted: Fitted
    probability: float
    log_factor: float
    spared: float

    @property
    def place(self) -> Place:
        """Where the effect acts."""
        assert self.fitted.place is not None
        return self.fitted.place


@dataclass(frozen=True)
class Verdicts:
    """Faults, likeliest first, and the probabilities of a limb in order and of something unknown."""

    faults: tuple[Weighed, ...]
    in_order: float
    unknown: float


def weigh(base: Fitted, candidates: Sequence[Fitted], sizes: Sizes, places: int) -> Verdicts:
    """The probabilities of a limb in order, of each candidate, and of something unknown.

    places: number of effects times joints of which the candidates are those worth a fit.
    """
    floor = sizes.discrepancy**2
    samples = base.fit.effective_samples * base.fit.inflation
    best = min((base, *candidates), key=lambda each: float(samples @ np.log(_variance(each.fit, floor))))
    effective = samples / best.fit.inflation

    def evidence(fitted: Fitted) -> float:
        return _of_runs(fitted.fit, floor, effective) + _of_unknowns(fitted, best.fit.inflation)

    own = evidence(base)
    in_order, logs = own, []
    for each in candidates:
        assert each.place is not None
        effect, size = each.place.effect, abs(each.size)
        shared = evidence(each) + 0.5 * np.log(2 * np.pi) + np.log(each.size_std + 1e-300)
        shared -= np.log(len(effect.laws))
        # Of half-normal density where it has no sign.
        sides = 1.0 if effect.two_sided else 2.0
        normal = np.log(sides / np.sqrt(2 * np.pi) / effect.healthy) - 0.5 * (size / effect.healthy) ** 2
        in_order = max(in_order, shared + normal)
        # A size at its bound is not the likeliest one.
        inside = effect.smallest <= size < INSIDE * effect.largest
        log_uniform = -np.log(size * np.log(effect.largest / effect.smallest)) if inside else -np.inf
        logs.append(shared + log_uniform - (np.log(2) if effect.two_sided else 0.0))
    left = _variance(base.fit, floor) * OTHER_LEAVES**2 + floor + sizes.noise**2
    gains = 0.5 * effective * np.log(_variance(base.fit, floor) / left)
    gains -= 0.5 * OTHER_UNKNOWNS * np.log(np.maximum(effective, 1.0))
    # Where the likeliest effect acts: that another joint has something unknown does not speak against it.
    likeliest = candidates[int(np.argmax(logs))].place if candidates else None
    there = None if likeliest is None else likeliest.joint
    other = own + float(np.max(gains) if there is None else gains[there])
    terms = np.array([in_order, other + np.log(OTHER)])
    terms = np.append(terms, np.array(logs) + np.log(FAULT / places))
    odds = np.exp(terms - terms.max())
    odds /= odds.sum()
    faults = [
        Weighed(each, float(odd), float(log - in_order), _shift(base) - _shift(each))
        for each, odd, log in zip(candidates, odds[2:], logs, strict=True)
    ]
    ranked = sorted(faults, key=lambda each: (-each.probability, -each.log_factor))
    return Verdicts(tuple(ranked), float(odds[0]), float(odds[1]))


def _variance(fit: Fit, floor: Array) -> Array:
    return fit.residual_std**2 + floor + 1e-24


def _of_runs(fit: Fit, floor: Array, effective: Array) -> float:
    return -0.5 * float(effective @ np.log(_variance(fit, floor)))


def _of_unknowns(fitted: Fitted, inflation: Array) -> float:
    """The prior at the fitted values and the volume of the posterior in it, the size of the effect left out.

    inflation: (n,) that all hypotheses are held to.
    """
    fit, unknown = fitted.fit, fitted.fit.unknowns
    precision = np.eye(unknown.count) + np.tensordot(fit.inflation / inflation, fit.information, axes=1)
    kept = _but_its_size(fitted)
    # The size's own volume is its deviation given the others' (Schur's complement).
    _, logdet = np.linalg.slogdet(precision[np.ix_(kept, kept)])
    return -_shift(fitted) - 0.5 * float(logdet)


def _shift(fitted: Fitted) -> float:
    """Minus the logarithm of the prior at the fitted values, the size of the effect left out."""
    fit, unknown = fitted.fit, fitted.fit.unknowns
    scaled = (fit.values - unknown.mean) / unknown.deviation
    return 0.5 * float(np.sum(scaled[_but_its_size(fitted)] ** 2))


def _but_its_size(fitted: Fitted) -> NDArray[np.bool_]:
    """The unknowns (m,) that are not the size of its effect."""
    kept = np.ones(fitted.fit.unknowns.count, dtype=bool)
    if fitted.place is not None and fitted.place.effect.smooth:
        kept[-1] = False
    return kept
