"""One measure for all hypotheses: how well left-out runs are predicted, and how far the parameters moved.

With the noise of each joint and the scales of the prior integrated out, both are logarithms:

    log L = -1/2 sum_j m_j log(squared held-out residual of joint j) - sum_k nu_k/2 log(b nu_k + distance_k)

m_j are the independent samples of joint j, distance_k the squared shift of the parameters of kind k (links,
friction) in units of the prior of prior.py, nu_k how many of them the runs can move, b the scale of the best
model; the timing error has a term of its own. An
effect that re-identified parameters absorb shows in the prior only.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import chain

import numpy as np
from numpy.typing import NDArray

from testbench.effects.signature import Family, Member

from ..model.candidate import Candidate, Place
from ..model.candidates import candidate
from ..model.gram import Bank
from ..model.hypothesis import Design, log_prior
from .normal_equations import Fit, log_of_squares, squares
from .score import Gain, Stage

Array = NDArray[np.float64]

# How sharply a difference in log-likelihood is believed: misfit is not noise. No law is quite the robot's, so
# a difference also counts against this share of what is explained at all.
TEMPERATURE, OF_EXPLAINED = 4.0, 0.02
# Log-likelihood by which one hypothesis is clearly favoured over another: by misfit alone any gains some.
SURELY = 8.0


@dataclass(frozen=True)
class Weighed:
    """A family's best member at a stage: its gain, and the log-likelihood it adds."""

    gain: Gain
    score: float

    @property
    def candidate(self) -> Candidate:
        """The member."""
        return self.gain.candidate


def gained(stage: Stage, gain: Gain) -> float:
    """Log-likelihood that a candidate adds to a stage's hypothesis."""
    return float(np.sum(gained_by_joint(stage, gain))) + gained_by_shift(stage, gain)


def gained_by_joint(stage: Stage, gain: Gain) -> Array:
    """The part of it that comes from each joint's prediction, (n,)."""
    return -0.5 * stage.independent * np.log(1 - stage.shares(gain))


def gained_elsewhere(stage: Stage, gain: Gain) -> float:
    """Log-likelihood that a candidate gains at all joints but its best one, and by the parameters' shift."""
    by_joint = gained_by_joint(stage, gain)
    return float(by_joint.sum() - by_joint.max()) + gained_by_shift(stage, gain)


def gained_by_shift(stage: Stage, gain: Gain) -> float:
    """The part of it that comes from parameters nearer to the model's."""
    return gain.prior - stage.prior


def log_likelihood(hypothesis: Design, fitted: Fit) -> float:
    """Log-likelihood of a fully fitted hypothesis, the mean of held-out and fitted ones; up to a constant.

    Where few runs cover a motion a left-out one is extrapolated to, and the law of fewer unknowns seems the
    better. Each effect pays for each of its coefficients and shapes instead (Schwarz, Ann. Statist. 1978).
    """
    held_out = log_of_squares(hypothesis.independent, squares(fitted.held_out))
    within = log_of_squares(hypothesis.independent, squares(fitted.residual))
    paid = sum(price(hypothesis, each) for each in hypothesis.accepted)
    return (held_out + within - paid) / 2 + float(log_prior(hypothesis, fitted.values))


def log_posterior(hypothesis: Design, fitted: Fit) -> float:
    """Log-posterior of a fully fitted hypothesis, of its fitted runs and prior; up to a constant.

    Where effects bend all parameters, these predict left-out runs by chance.
    """
    within = log_of_squares(hypothesis.independent, squares(fitted.residual))
    return within + float(log_prior(hypothesis, fitted.values))


def by_chance(candidate: Candidate) -> float:
    """Log-likelihood that the coefficients of an effect gain by chance, beyond those of one that has two.

    One each (Akaike, IEEE Trans. Automatic Control 19(6), 1974). A payload has up to ten.
    """
    free = int(np.sum(candidate.member.upper > candidate.member.lower))
    return float(max(free - 2, 0))


def price(hypothesis: Design, candidate: Candidate) -> float:
    """Price of an effect: half the logarithm of its samples for each fitted coefficient and shape (BIC)."""
    samples = float(np.max(hypothesis.independent[list(candidate.member.rows)]))
    return 0.5 * (candidate.count + len(candidate.member.shape)) * float(np.log(max(samples, 1.0)))


def weigh(stage: Stage, *banks: Bank, allowed: Callable[[Gain], bool] = lambda gain: True) -> list[Weighed]:
    """Each family's best member among those allowed, best first."""
    families: dict[Place, Weighed] = {}
    for gain in chain.from_iterable(map(stage.gains, banks)):
        if gain is None or not allowed(gain):
            continue
        weighed = Weighed(gain, gained(stage, gain))
        place = gain.candidate.place
        if place not in families or _likeliness(weighed) > _likeliness(families[place]):
            families[place] = weighed
    return sorted(families.values(), key=lambda w: -w.score)


def likeliest_of(stage: Stage, family: Family, members: Sequence[Member]) -> list[Weighed]:
    """The likeliest of some members of a family; nothing where none shows."""
    return weigh(stage, Bank(stage.base, [candidate(stage.prepared, family, each) for each in members]))


def _likeliness(weighed: Weighed) -> float:
    """Score less the logarithm of the number of shapes tried, since one of many shapes fits by chance."""
    return weighed.score - float(np.log(weighed.candidate.shapes))


def odds(log_likelihoods: Sequence[float], explained: float, before: Sequence[float]) -> Array:
    """Probabilities of hypotheses, one of which is taken to be true; summing to one.

    explained: what the best of them adds to none of them. before: how likely each is whatever the runs say,
    as a multiple of any other.
    """
    values = np.asarray(log_likelihoods)
    weights = np.asarray(before) * np.exp(
        (values - values.max()) / max(TEMPERATURE, OF_EXPLAINED * explained)
    )
    return weights / weights.sum()
