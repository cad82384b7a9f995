"""Figures of a study: shares with Wilson intervals, calibration, risk against coverage."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.stats import binomtest

CONFIDENCE = 0.95


@dataclass(frozen=True)
class Share:
    """How many of how many, with the Wilson interval of the probability behind it (95 %).

    Wilson, "Probable inference, the law of succession, and statistical inference", JASA 22, 1927.
    """

    count: int
    total: int

    @property
    def value(self) -> float | None:
        """count / total; None of nothing."""
        return self.count / self.total if self.total else None

    @property
    def interval(self) -> tuple[float, float]:
        """Lower and upper end; 0 and 1 of nothing."""
        if not self.total:
            return 0.0, 1.0
        found = binomtest(self.count, self.total).proportion_ci(CONFIDENCE, method="wilson")
        return float(found.low), float(found.high)

    def __str__(self) -> str:
        if self.value is None:
            return "none"
        low, high = self.interval
        return f"{self.count} of {self.total}, {self.value:.0%} ({low:.0%} to {high:.0%})"


@dataclass(frozen=True)
class Bin:
    """Statements of about one probability. stated: their mean probability. right: how many were so."""

    stated: float
    right: Share


def reliability(stated: ArrayLike, right: ArrayLike, bins: int = 10) -> tuple[Bin, ...]:
    """Statements in bins of equal width of their probability, the empty ones left out.

    stated: (N,) 0 to 1. right: (N,) bool.
    """
    probability, so = np.asarray(stated, dtype=float), np.asarray(right, dtype=bool)
    place = np.minimum((probability * bins).astype(int), bins - 1)
    found = []
    for each in np.unique(place).tolist():
        inside = place == each
        found.append(Bin(float(probability[inside].mean()), Share(int(so[inside].sum()), int(inside.sum()))))
    return tuple(found)


def calibration_error(stated: ArrayLike, right: ArrayLike, bins: int = 10) -> float | None:
    """Expected calibration error: mean distance of stated and found over the bins, by their counts; or None.

    Naeini, Cooper & Hauskrecht, "Obtaining well calibrated probabilities using Bayesian binning", AAAI 2015.
    """
    found = reliability(stated, right, bins)
    total = sum(each.right.total for each in found)
    if not total:
        return None
    off = [abs(each.right.count - each.right.total * each.stated) for each in found]
    return float(sum(off) / total)


def risk_and_coverage(stated: Sequence[float | None], right: Sequence[bool]) -> list[tuple[float, float]]:
    """(coverage, risk), as shares, for each least probability that one acts on.

    stated: of each case's first name, None where it abstains. Ties are taken together. El-Yaniv & Wiener, "On
    the foundations of noise-free selective classification", JMLR 11, 2010.
    """
    answered = [(each, so) for each, so in zip(stated, right, strict=True) if each is not None]
    curve = []
    for least in sorted({each for each, _ in answered}, reverse=True):
        taken = [so for each, so in answered if each >= least]
        curve.append((len(taken) / len(stated), 1 - sum(taken) / len(taken)))
    return curve
