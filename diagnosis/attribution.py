"""Which effect it is: hypotheses grown one effect at a time, judged on runs that were left out.

At every stage each family of the catalogue is weighed against the hypothesis so far; the one that
predicts left-out runs best is refined, fitted jointly with everything else, and taken in if what it
explains is material. Effects that re-identification swallows are sought in the shift of the
parameters instead: the prior of prior.py makes that shift cost what it is worth.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from identification.parameters import PER_JOINT
from testbench.effects import effects

from .candidates import Candidate, candidate, candidates
from .evidence import Design, Fit, Gain, Stage, design, determined, fit, torque_rms
from .generic import generic_candidates
from .preparation import Prepared

Array = NDArray[np.float64]

# An effect is material when it removes this share of a joint's held-out squared residual ...
SMALLEST_SHARE = 0.10
# ... and at least this much of the joint's RMS torque.
SMALLEST_TORQUE = 0.006
# Twice the log-likelihood that a shift of parameters must cost before it is called an effect.
SMALLEST_SHIFT = 15.0
# Columns that the parameters' columns span to this share show in the parameters' shift alone.
HIDDEN_OVERLAP = 0.9
MOST_EFFECTS = 6
SHORTLIST = 4
# Members of a family that are weighed again at later stages.
LEADING_MEMBERS = 3
# A free function of the motion that explains this much more than the best named effect is unknown.
UNKNOWN_SHARE = 0.25
# How sharply a difference in held-out log-likelihood is believed, coloured misfit considered.
TEMPERATURE = 4.0
CONTACT = "external_contact"
WORLD = ("encoder_offset", "encoder_eccentricity", "payload", "base_tilt", "torque_gain_error")


@dataclass(frozen=True)
class Weighed:
    """A family's best member at a stage: its gain, and its score in held-out log-likelihood units."""

    gain: Gain
    score: float

    @property
    def candidate(self) -> Candidate:
        """The member."""
        return self.gain.candidate


@dataclass(frozen=True)
class Accepted:
    """An effect taken in, with the rivals it was preferred to at its stage and their probabilities."""

    candidate: Candidate
    probability: float
    rivals: tuple[tuple[Weighed, float], ...]
    share: float


@dataclass(frozen=True)
class Attribution:
    """The hypothesis found. unknown: (joint, regime) of structure that no effect explains."""

    prepared: Prepared
    accepted: tuple[Accepted, ...]
    hypothesis: Design
    fitted: Fit
    parameters_only: tuple[Design, Fit]
    unknown: tuple[tuple[int, str, float], ...]
    last_stage: tuple[Weighed, ...]


def attribute(prepared: Prepared, without: Sequence[str] = ()) -> Attribution:
    """Grow the hypothesis from "parameters only" until nothing material is left to explain."""
    prepared = linearised(prepared, *_fitted(prepared, []))
    hypothesis, fitted = _fitted(prepared, [])
    first = hypothesis, fitted
    # A push of the surroundings can imitate anything for a while: it is weighed last.
    early = [*without, CONTACT]
    proposals, free = candidates(prepared, early), generic_candidates(prepared)
    accepted: list[Accepted] = []
    unknown: list[tuple[int, str, float]] = []
    weighed: list[Weighed] = []
    while len(accepted) < MOST_EFFECTS:
        stage = Stage(prepared, hypothesis, fitted)
        weighed, leading = _weigh(stage, proposals)
        taken = {item.candidate.place for item in accepted}
        open_ = [w for w in weighed if w.candidate.place not in taken]
        if not open_:
            break
        best, rivals, trial = _choose(prepared, stage, accepted, open_)
        generic, _ = _weigh(stage, free)
        unknown = _unclaimed(stage, generic, best)
        if not _material(stage, best.gain):
            last = _shifted(prepared, stage, accepted, open_)
            last = last or _contact(prepared, stage, without, taken)
            if last is None:
                break
            best, rivals = last
            trial = _fitted(prepared, [*(a.candidate for a in accepted), best.candidate])
        share = _shares(stage, best.gain).max()
        probability = 1.0 - sum(p for _, p in rivals)
        accepted.append(Accepted(best.candidate, probability, rivals, float(share)))
        hypothesis, fitted = trial
        # Shapes that were far behind from the start do not come back.
        proposals = leading
        if best.candidate.family.effect in WORLD:
            prepared = linearised(prepared, hypothesis, fitted)
            proposals = candidates(prepared, early)
            accepted = [replace(a, candidate=_again(prepared, a.candidate)) for a in accepted]
            hypothesis, fitted = _fitted(prepared, [a.candidate for a in accepted])
    accepted, hypothesis, fitted = _pruned(prepared, accepted, hypothesis, fitted)
    return Attribution(prepared, tuple(accepted), hypothesis, fitted, first, tuple(unknown), tuple(weighed))


def linearised(prepared: Prepared, hypothesis: Design, fitted: Fit) -> Prepared:
    """The runs with loads and derivatives taken at the parameters just fitted."""
    return prepared.with_parameters(standard_values(prepared, fitted))


def standard_values(prepared: Prepared, fitted: Fit) -> Array:
    """Standard parameters (14 n,) of a fit."""
    return prepared.nominal + fitted.values[: PER_JOINT * prepared.joints]


def _fitted(prepared: Prepared, accepted: Sequence[Candidate]) -> tuple[Design, Fit]:
    hypothesis = design(prepared, accepted)
    return hypothesis, fit(prepared, hypothesis)


def _again(prepared: Prepared, old: Candidate) -> Candidate:
    """The same member recomputed after the runs were linearised anew."""
    logged = [run.logged for run in prepared.runs]
    family = effects()[old.family.effect].signature(logged, old.family.joint, old.family.into)
    if family.member is not None and old.member.shape:
        return candidate(prepared, family, family.member(old.member.shape))
    return candidate(prepared, family, family.members[0])


def _shares(stage: Stage, gain: Gain) -> Array:
    """Share of each joint's held-out squared residual that a candidate removes, (n,)."""
    return np.clip(gain.held_out / np.maximum(stage.held_squares, 1e-300), -1.0, 0.999)


def _score(stage: Stage, gain: Gain) -> float:
    """Held-out log-likelihood gained, each joint's noise estimated: -1/2 sum m_j log(1 - share_j)."""
    return float(-0.5 * np.sum(stage.effective_samples * np.log(1 - _shares(stage, gain))))


def _weigh(stage: Stage, proposals: Sequence[Candidate]) -> tuple[list[Weighed], list[Candidate]]:
    """Each family's best member, best first; and the few best members of every family."""
    families: dict[tuple[str, int | None, int | None], list[Weighed]] = {}
    for proposal in proposals:
        gain = stage.gain(proposal)
        if gain is not None:
            families.setdefault(proposal.place, []).append(Weighed(gain, _score(stage, gain)))
    for members in families.values():
        members.sort(key=lambda w: -w.score)
    best = sorted((members[0] for members in families.values()), key=lambda w: -w.score)
    leading = [w.candidate for members in families.values() for w in members[:LEADING_MEMBERS]]
    return best, leading


def _contact(
    prepared: Prepared, stage: Stage, without: Sequence[str], taken: set[tuple[str, int | None, int | None]]
) -> tuple[Weighed, tuple[tuple[Weighed, float], ...]] | None:
    """A material push of the surroundings, where nothing else explains what is left."""
    if CONTACT in without:
        return None
    weighed, _ = _weigh(stage, candidates(prepared, without, (CONTACT,)))
    open_ = [w for w in weighed if w.candidate.place not in taken and _material(stage, w.gain)]
    return (open_[0], ()) if open_ else None


def _refined(prepared: Prepared, stage: Stage, weighed: Weighed) -> Weighed:
    """The family's best member at any shape near the best of its grid."""
    family = weighed.candidate.family
    if not family.refine or family.member is None:
        return weighed
    names = list(family.refine)
    lower = np.array([family.refine[name][0] for name in names])
    upper = np.array([family.refine[name][1] for name in names])
    span = np.where(upper > lower, upper - lower, 1.0)
    member = family.member
    best = weighed

    def negative(u: Array) -> float:
        nonlocal best
        shape = dict(weighed.candidate.member.shape)
        shape |= {
            name: float(value) for name, value in zip(names, lower + np.clip(u, 0, 1) * span, strict=True)
        }
        gain = stage.gain(candidate(prepared, family, member(shape)))
        if gain is None:
            return 0.0
        score = _score(stage, gain)
        if score > best.score:
            best = Weighed(gain, score)
        return -score

    start = (np.array([weighed.candidate.member.shape[name] for name in names]) - lower) / span
    simplex = np.vstack([start, *(np.clip(start + 0.12 * e, 0, 1) for e in np.eye(len(names)))])
    minimize(negative, start, method="Nelder-Mead", options={"maxfev": 14, "initial_simplex": simplex})
    return best


def _choose(
    prepared: Prepared, stage: Stage, accepted: Sequence[Accepted], open_: Sequence[Weighed]
) -> tuple[Weighed, tuple[tuple[Weighed, float], ...], tuple[Design, Fit]]:
    """The shortlist refined and fitted jointly in full: the best, its rivals with their probabilities."""
    shortlist = [_refined(prepared, stage, w) for w in open_[:SHORTLIST]]
    before = [a.candidate for a in accepted]
    trials = [_fitted(prepared, [*before, w.candidate]) for w in shortlist]
    best_fit = min(range(len(trials)), key=lambda i: _held_log(stage, trials[i], None))
    samples = Stage(prepared, *trials[best_fit]).effective_samples
    likelihood = np.array([-0.5 * _held_log(stage, trial, samples) for trial in trials])
    order = np.argsort(-likelihood, kind="stable")
    odds = np.exp((likelihood - likelihood[order[0]]) / TEMPERATURE)
    probability = odds / odds.sum()
    rivals = tuple((shortlist[i], float(probability[i])) for i in order[1:])
    return shortlist[order[0]], rivals, trials[order[0]]


def _held_log(stage: Stage, trial: tuple[Design, Fit], samples: Array | None) -> float:
    """Sum of m_j log(held-out squared residual of joint j)."""
    squares = sum(np.sum(held**2, axis=0) for held in trial[1].held_out)
    weights = stage.counts if samples is None else samples
    return float(np.sum(weights * np.log(np.maximum(squares, 1e-300))))


def _material(stage: Stage, gain: Gain) -> bool:
    """Whether a candidate explains enough of some joint's torque on runs left out."""
    removed = np.sqrt(np.maximum(gain.held_out, 0) / np.maximum(stage.counts, 1))
    torque = torque_rms(stage.prepared)
    return bool(np.any((_shares(stage, gain) > SMALLEST_SHARE) & (removed > SMALLEST_TORQUE * torque)))


def _shifted(
    prepared: Prepared, stage: Stage, accepted: Sequence[Accepted], open_: Sequence[Weighed]
) -> tuple[Weighed, tuple[tuple[Weighed, float], ...]] | None:
    """The effect that best explains a shift of the parameters beyond CAD's, and its rivals.

    Judged by twice the log-likelihood: squared residuals at the stage's weights, and the logarithm
    by which the heavy-tailed prior penalises the shift.
    """
    hidden = [w for w in open_ if w.candidate.family.swallowed or w.gain.overlap > HIDDEN_OVERLAP]
    shortlist = sorted(hidden, key=lambda w: -w.gain.objective)[:SHORTLIST]
    worth = []
    for weighed in shortlist:
        _, trial = _fitted(prepared, [*(a.candidate for a in accepted), weighed.candidate])
        explained = sum(
            float(np.sum(stage.weights * (before**2 - after**2)))
            for before, after in zip(stage.fitted.residual, trial.residual, strict=True)
        )
        shift = determined(prepared) * np.log(stage.fitted.prior_scale / trial.prior_scale)
        worth.append(explained + shift)
    if not worth or max(worth) < SMALLEST_SHIFT:
        return None
    order = np.argsort(-np.array(worth), kind="stable")
    odds = np.exp((np.array(worth) - max(worth)) / 2)
    probability = odds / odds.sum()
    return shortlist[order[0]], tuple((shortlist[i], float(probability[i])) for i in order[1:])


def _unclaimed(stage: Stage, generic: Sequence[Weighed], best: Weighed) -> list[tuple[int, str, float]]:
    """Joints at which a free function explains materially more than the best named effect does."""
    found = []
    for item in generic:
        joint = item.candidate.family.joint
        assert joint is not None
        share = _shares(stage, item.gain)[joint]
        named = max(_shares(stage, best.gain)[joint], 0.0)
        if _material(stage, item.gain) and share > UNKNOWN_SHARE and share > named + 0.5 * UNKNOWN_SHARE:
            found.append((joint, item.candidate.family.effect.removeprefix("unknown: "), float(share)))
    return sorted(found, key=lambda f: -f[2])


def _pruned(
    prepared: Prepared, accepted: list[Accepted], hypothesis: Design, fitted: Fit
) -> tuple[list[Accepted], Design, Fit]:
    """Take out, one by one, what is no longer material beside the others."""
    while len(accepted) > 1:
        rest = [
            _fitted(prepared, [a.candidate for k, a in enumerate(accepted) if k != leave])
            for leave in range(len(accepted))
        ]
        worth = []
        for leave, trial in enumerate(rest):
            stage = Stage(prepared, *trial)
            gain = stage.gain(accepted[leave].candidate)
            keeps = gain is not None and (_material(stage, gain) or gain.objective > SMALLEST_SHIFT)
            worth.append((keeps, 0.0 if gain is None else _score(stage, gain)))
        weakest = min(range(len(worth)), key=lambda k: (worth[k][0], worth[k][1]))
        if worth[weakest][0]:
            break
        accepted = [a for k, a in enumerate(accepted) if k != weakest]
        hypothesis, fitted = rest[weakest]
    return accepted, hypothesis, fitted
