"""Probability that a fitted effect is a fault of this robot: by its size, and by how much it explains.

Every joint is a little imperfect, so an effect that was found may be one of its imperfections. With x the
logarithm of its size, as a multiple of what healthy joints usually reach, two hypotheses are compared:

    healthy: x is about this robot's own level, by Student's t. The level is normal over robots, and the
             same effect at the robot's other joints shows it.
    fault:   x is uniform up to the largest sizes that are met.

    p / (1 - p) = PRIOR · f_fault(x) / f_healthy(x) · (e / (1 - e))^EXPLAINED

e is the share of what its joint leaves that the effect explains: a fault's own law explains nearly all of it,
a law that only resembles it a part. Of an effect that re-identified parameters absorb it is the shift of
these that it spares. A random-effects model: Gelman et al., "Bayesian Data Analysis", 3rd ed., 2013,
chapter 5.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import expit, log_ndtr, logit
from scipy.stats import t as student

Array = NDArray[np.float64]

# Of the logarithm of healthy sizes: its mean over robots, the deviation between robots and between the joints
# of one, the degrees of freedom of its tails. LARGEST: the multiple that faults reach. The odds of a fault
# among what is worth fitting, and the weight of what it explains. Estimated from the effects found on drawn
# robots of six independent plants and of the blind study, and judged with each left out (docs/plants.md).
LEVEL, BETWEEN, WITHIN, TAILS, LARGEST = -1.4, 0.39, 0.38, 4.0, 60.0
PRIOR, EXPLAINED = 0.12, 0.58
# A share nearer to none or all says no more than this; this log-likelihood of the parameters' shift is most.
NEAREST, SHIFT = 0.03, 10.0
# From this probability on a name is stated: where a wrong one costs as much as ten right ones are worth, on
# plants left out no other level is worth more.
STATED = 0.75
# What is outside of this model may be wrong as well; and one run does not show what another would.
MODEL_HOLDS, ONE_RUN = 0.98, 0.8


@dataclass(frozen=True)
class Size:
    """An effect's size at a joint, None for the whole robot, as a multiple of what healthy joints reach."""

    effect: str
    joint: int | None
    times: float


def held_by(runs: int) -> float:
    """The largest probability that so many runs can give, however sure they seem."""
    return MODEL_HOLDS * (ONE_RUN if runs < 2 else 1.0)


def share_explained(share: float, shift: float) -> float:
    """The share of an error that an effect explains, where re-identified parameters may absorb it.

    share: of what re-identification leaves. shift: log-likelihood of the parameters' shift that it spares.
    """
    return float(max(share, -np.expm1(-max(shift, 0.0) / SHIFT)))


def fault_probability(own: Size, seen: Sequence[Size], share: float, shift: float, runs: int) -> float:
    """The probability that an effect is a fault and no imperfection, by so many runs.

    seen: what was found on this robot; the same effect at other joints counts. share: of its joint's held-out
    squared residual that it explains. shift: log-likelihood of the parameters' shift that it spares.
    """
    if not np.isfinite(own.times):
        # No healthy robot has any of it.
        return held_by(runs)
    others = [each.times for each in seen if each.effect == own.effect and each.joint != own.joint]
    explained = np.clip(share_explained(share, shift), NEAREST, 1 - NEAREST)
    log_odds = np.log(PRIOR) + _log_ratio(own.times, np.array(others)) + EXPLAINED * logit(explained)
    return float(held_by(runs) * expit(log_odds))


def _log_ratio(times: float, others: Array) -> float:
    """Logarithm of f_fault / f_healthy. times: the effect's size. others: (k,) sizes at other joints."""
    known = np.log(others[np.isfinite(others) & (others > 0)])
    precision = 1 / BETWEEN**2 + len(known) / WITHIN**2
    level = (LEVEL / BETWEEN**2 + known.sum() / WITHIN**2) / precision
    deviation = float(np.sqrt(WITHIN**2 + 1 / precision))
    x, most = float(np.log(max(times, np.finfo(float).tiny))), float(np.log(LARGEST))
    # Both ends of the uniform density are as wide as joints differ.
    fault = log_ndtr(x / WITHIN) + log_ndtr((most - x) / WITHIN) - np.log(most)
    return float(fault - student.logpdf(x, TAILS, level, deviation))
