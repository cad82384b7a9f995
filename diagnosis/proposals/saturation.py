"""A drive that gives less than it was asked for: fitted where nothing is clipped, judged where it is.

With a limit L the drive gave clip(asked, ±L). The samples beyond L take no part in the fit, or a small
limit would explain the torque by itself; they are predicted, once as asked for and once as clipped.
"""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d
from scipy.optimize import minimize_scalar

from testbench.effects import effect
from testbench.effects.signature import Family

from ..data.run import Prepared
from ..fit.bounded import solve
from ..fit.likelihood import SURELY, Weighed
from ..fit.normal_equations import log_of_squares
from ..fit.score import Gain, Stage
from ..model.candidate import SATURATION, Candidate
from ..model.candidates import candidate
from ..model.gram import Bank
from ..model.hypothesis import log_prior
from ..residual.unexplained import predicted_shares
from .flat_top import APART

Array = NDArray[np.float64]

# Limits tried: by the share of samples beyond, and as shares of the peak where a controller has run away.
TRIED = 11
CLIPPED, OF_PEAK = np.geomspace(0.002, 0.3, TRIED), np.geomspace(0.9, 0.02, TRIED)
# Then it asks for all it may: the limit in the middle is this near the largest; a report is noisy.
AT_PEAK = 0.96
# Share of the squared error beyond the limit that clipping must explain.
SMALLEST_SHARE = 0.9
# What a ringing filter adds to the largest time, or clipping leaves of a single one (of a push, a tenth).
NEARLY_NONE = 0.02
REFINEMENTS = 12
# Of an unknown's information, relative.
ROUNDING = 1e-9


@dataclass(frozen=True)
class Cut:
    """A torque limit (N·m) of a joint as a candidate effect, with the samples that it clips.

    beyond: a run's samples (M,) that the filter fills from beyond the limit.
    """

    joint: int
    limit: float
    candidate: Candidate
    beyond: tuple[NDArray[np.bool_], ...]


@dataclass(frozen=True)
class _Trial:
    """Gain in likelihood of a limit, its share of the joint's residual, and whether it clips as one."""

    cut: Cut
    score: float
    share: float
    clips: bool
    values: Array
    held_squares: Array


def cuts(prepared: Prepared) -> list[list[Cut]]:
    """Candidate torque limits of each joint, those that clip least first; they depend on the logs only."""
    logged = [run.logged for run in prepared.runs]

    def of_joint(joint: int) -> list[Cut]:
        family = effect(SATURATION).signature(logged, joint, None)
        if not family.members:
            return []
        asked = np.concatenate([np.abs(torque) for torque in asked_torque(prepared, joint)])
        limits = np.quantile(asked, 1 - CLIPPED)
        if limits[TRIED // 2] > AT_PEAK * limits[0]:
            limits = np.append(limits, asked.max() * OF_PEAK)
        # Within one of its steps the log does not distinguish a limit from rounding.
        limits = limits[limits > prepared.torque_step[joint]]
        return [_cut(prepared, family, limit) for limit in np.unique(limits)[::-1].tolist()]

    with ThreadPoolExecutor() as pool:
        return list(pool.map(of_joint, range(prepared.joints)))


def saturation(stage: Stage, free: Bank, limits: Sequence[Sequence[Cut]]) -> Weighed | None:
    """The joint whose drive clips, at its likeliest limit; None where none does that is not accepted yet.

    free: candidates of generic.py; what one of them explains better has nothing to do with a limit.
    limits: of ``cuts``.
    """
    known = stage.hypothesis.joints_with(SATURATION)
    found: list[_Trial] = []
    for joint, tried in enumerate(limits):
        trial = None if joint in known else _likeliest(stage, tried)
        if trial is not None and trial.clips:
            found.append(trial)
    predicted = predicted_shares(stage, free) if found else np.zeros(0)
    found = [each for each in found if each.share > predicted[each.cut.joint]]
    if not found:
        return None
    best = max(found, key=lambda trial: trial.score)
    return Weighed(_gain(stage, best), best.score)


def _likeliest(stage: Stage, limits: Sequence[Cut]) -> _Trial | None:
    scored = [(trial, k) for k, cut in enumerate(limits) if (trial := _trial(stage, cut)) is not None]
    if not scored:
        return None
    best, at = max(scored, key=lambda each: each[0].score)
    if best.score <= SURELY:
        return None
    family = best.cut.candidate.family
    # A command that runs away passes all limits between two quantiles at once: that next to the likeliest may
    # clip too little to be tried itself.
    ends = limits[min(at + 1, len(limits) - 1)].limit, limits[max(at - 1, 0)].limit
    tried: dict[float, _Trial] = {}

    def negative(limit: float) -> float:
        trial = _trial(stage, _cut(stage.prepared, family, limit))
        if trial is None:
            return 0.0
        tried[limit] = trial
        return -trial.score

    if ends[1] > ends[0]:
        minimize_scalar(negative, bounds=ends, method="bounded", options={"maxiter": REFINEMENTS})
    return max([best, *tried.values()], key=lambda trial: trial.score)


def _cut(prepared: Prepared, family: Family, limit: float) -> Cut:
    assert family.member is not None
    assert family.joint is not None
    made = candidate(prepared, family, family.member({"limit": limit}))
    beyond = []
    for run, torque in zip(prepared.runs, asked_torque(prepared, family.joint), strict=True):
        # The filter smears what is cut off over a cut-off period.
        reach = round(run.logged.sample_rate / run.logged.cutoff)
        beyond.append(maximum_filter1d(np.abs(torque), reach)[run.kept] > limit)
    return Cut(family.joint, limit, made, tuple(beyond))


def asked_torque(prepared: Prepared, joint: int) -> list[Array]:
    """Torque asked of the drive, a run (N,) N·m: the command where logged, else the reported torque."""
    logged = [run.logged for run in prepared.runs]
    return [(run.tau if run.torque_command is None else run.torque_command)[:, joint] for run in logged]


def _trial(stage: Stage, limit: Cut) -> _Trial | None:
    base, weights, joint = stage.base, stage.weights, limit.joint
    folds, n, loading = range(len(base.folds)), base.joints, stage.hypothesis.loading
    cut = [base.rows_of(limit.candidate.filtered, f, joint, 0)[:, 0] for f in folds]
    used = [base.used[f][joint] for f in folds]
    beyond = [limit.beyond[run][used[f]] for f, (run, _) in enumerate(base.folds)]
    # Of a limit the error rises with what it cuts off.
    if sum(stage.held[f][joint][beyond[f]] @ cut[f][beyond[f]] for f in folds) <= 0:
        return None
    # A fold's normal equations, less the rows beyond the limit.
    xx, xy = [], []
    for f in folds:
        x, y, out = stage.hypothesis.x(f, joint), base.y[f][joint], beyond[f]
        xx.append(stage.parts[f].copy())
        xx[f][loading[joint][:, None], loading[joint]] -= weights[joint] * x[out].T @ x[out]
        xy.append(weights @ stage.xy[f])
        xy[f][loading[joint]] -= weights[joint] * x.T @ np.where(out, y, cut[f])
    lower, upper = stage.fitted.bounds
    whole = stage.parts.sum(axis=0) + stage.precision
    values = solve(_of_what_is_left(sum(xx) + stage.precision, whole), sum(xy), lower, upper)
    squares = np.zeros(n)
    bouts: list[tuple[float, float]] = []
    for f in folds:
        apart = _of_what_is_left(sum(xx) - xx[f] + stage.precision, whole)
        own = solve(apart, sum(xy) - xy[f], lower, upper)
        for j in range(n):
            left = base.y[f][j] - stage.hypothesis.x(f, j) @ own[loading[j]]
            if j == joint:
                out = beyond[f]
                before = left[out] ** 2
                left = left - cut[f]
                bouts += _bouts(stage, f, joint, out, cut[f][out], before, left[out] ** 2)
            squares[j] += float(np.sum(left**2))
    # A joint that stands still leaves nothing, before and after.
    left_over = np.divide(squares, stage.held_squares, out=np.ones(n), where=stage.held_squares > 0)
    likelihood = log_of_squares(stage.independent, left_over)
    prior_gain = float(log_prior(stage.hypothesis, values)) - stage.prior
    asked_for, clipped = np.array(bouts).T
    # A push makes the torque large once; a drive clips again whenever as much is asked of it, either way.
    explained = clipped < (1 - SMALLEST_SHARE) * asked_for
    again = np.sum(explained & (asked_for > NEARLY_NONE * asked_for.max())) > 1
    most_left = (1 - SMALLEST_SHARE if again else NEARLY_NONE) * asked_for.sum()
    return _Trial(
        cut=limit,
        score=likelihood + prior_gain,
        share=float(1 - squares[joint] / stage.held_squares[joint]),
        clips=bool(clipped.sum() < most_left),
        values=values,
        held_squares=squares,
    )


def _of_what_is_left(matrix: Array, whole: Array) -> Array:
    """Information (p, p) without the unknowns of which subtraction from the whole has left rounding alone."""
    gone = np.diag(matrix) <= ROUNDING * np.diag(whole)
    return np.where(gone[:, None] | gone, 0.0, matrix)


def _bouts(
    stage: Stage,
    fold: int,
    joint: int,
    beyond: NDArray[np.bool_],
    cut: Array,
    asked_for: Array,
    clipped: Array,
) -> list[tuple[float, float]]:
    """Squared error beyond the limit, as asked for and as clipped, for each time that it was passed.

    cut: what is cut off there; each way is a time of its own.
    """
    run, _ = stage.base.folds[fold]
    time = stage.prepared.runs[run].time[stage.base.used[fold][joint]][beyond]
    another = (np.diff(time) > APART) | (np.diff(np.sign(cut)) != 0)
    parts = np.split(np.arange(len(time)), np.flatnonzero(another) + 1)
    return [(float(asked_for[part].sum()), float(clipped[part].sum())) for part in parts if len(part)]


def _gain(stage: Stage, trial: _Trial) -> Gain:
    return Gain(
        candidate=trial.cut.candidate,
        objective=float(np.sum(stage.weights * (stage.held_squares - trial.held_squares))),
        held_out=stage.held_squares - trial.held_squares,
        coefficients=np.ones(1),
        overlap=0.0,
        prior=float(log_prior(stage.hypothesis, trial.values)),
        information=np.ones((1, 1)),
    )
