"""The convention that a log counts by, searched jointly: order, signs, zeros, scales and gravity at once.

One mistake hides another: with a zero that is off no sign looks right. Conventions one mistake away from the
best so far are screened by the model as given; the best of them are weighed with the model's own uncertainty,
and the search goes on from these.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from identification.chain import Chain

from .convention import Convention, as_modelled, mistakes
from .model_fit import Explained, ModelFit
from .scale_search import rescaled
from .screening import Screening

# Logarithm of the odds against any one mistake before a log is seen.
PER_MISTAKE = 7.0
# Conventions that are followed up, those weighed after a screening of one, rounds at most.
BEAM, WEIGHED, ROUNDS = 3, 8, 5
# A model explains a joint, and its parameters are not bent, where this share of torque is left, RMS, and they
# are this many of their widths off, a joint.
LEFT, BENT = 0.2, 1.4


@dataclass(frozen=True)
class Candidate:
    """A convention and how well it explains the samples."""

    convention: Convention
    explained: Explained

    @property
    def score(self) -> float:
        """Logarithm of the posterior odds, up to a constant."""
        return self.explained.evidence - PER_MISTAKE * mistakes(self.convention)


def is_plain(candidate: Candidate) -> bool:
    """Whether the model explains all joints so well that nothing need be searched."""
    return not _is_unexplained(candidate).any()


def _is_unexplained(candidate: Candidate) -> NDArray[np.bool_]:
    """(n,) whether the model leaves much of a joint's torque; of all where it must be bent."""
    left = np.nan_to_num(candidate.explained.left)
    return np.asarray((left >= LEFT) | (candidate.explained.bent >= BENT))


def doubtful_joints(chain: Chain, candidate: Candidate) -> list[int]:
    """The joints that may count otherwise: torques that their positions change are not explained.

    A joint's position changes the torques of itself and of those before and after it on its branch.
    """
    on_branch = chain.moves | chain.moves.T
    return [int(each) for each in np.flatnonzero(on_branch[_is_unexplained(candidate)].any(axis=0))]


def search(fit: ModelFit) -> tuple[Candidate, Candidate]:
    """The candidate as modelled, and the likeliest of all; one where no mistake makes the log likelier."""
    screening = Screening(fit.robot, fit.samples, fit.independent)
    first = _weighed(fit, as_modelled(fit.robot.joints))
    if is_plain(first):
        return first, first
    known = {first.convention: first}
    followed: set[Convention] = set()
    for _ in range(ROUNDS):
        beam = sorted(known.values(), key=lambda each: -each.score)[:BEAM]
        fresh = [each for each in beam if each.convention not in followed]
        if not fresh:
            break
        for candidate in fresh:
            followed.add(candidate.convention)
            joints = doubtful_joints(fit.robot.chain, candidate)
            for convention in screening.likeliest(candidate.convention, WEIGHED, joints):
                if convention not in known:
                    known[convention] = _weighed(fit, convention)
    best = max(known.values(), key=lambda each: each.score)
    return first, _simplest(fit, _rescaled(fit, _simplest(fit, best)))


def _weighed(fit: ModelFit, convention: Convention) -> Candidate:
    return Candidate(convention, fit.under(convention))


def _rescaled(fit: ModelFit, best: Candidate) -> Candidate:
    """The candidate with other scales, where a joint is not explained as it is."""
    if is_plain(best) and all(factor == 1 for factor in best.convention.scale):
        return best
    joints = doubtful_joints(fit.robot.chain, best)
    convention = rescaled(lambda each: _weighed(fit, each).score, best.convention, joints)
    return _weighed(fit, convention)


def _simplest(fit: ModelFit, best: Candidate) -> Candidate:
    """The candidate without the mistakes that do not make it likelier."""
    while True:
        simpler = [_weighed(fit, each) for each in _without_one(best.convention)]
        better = max(simpler, key=lambda each: each.score, default=best)
        if better.score <= best.score:
            return best
        best = better


def _without_one(convention: Convention) -> list[Convention]:
    """The convention without one of its mistakes, one each."""
    found, n = [], len(convention.zero)
    plain = as_modelled(n)
    for joint in range(n):
        both = replace(
            convention.with_value("position_sign", joint, 1.0).with_value("torque_sign", joint, 1.0)
        )
        found += [convention.with_value("zero", joint, 0.0), convention.with_value("scale", joint, 1.0), both]
        found += [convention.with_value(field, joint, 1.0) for field in ("position_sign", "torque_sign")]
    found += [replace(convention, **{field: getattr(plain, field)}) for field in vars(plain)]
    return [each for each in dict.fromkeys(found) if each != convention]
