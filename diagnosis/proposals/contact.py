"""A push of the surroundings: short bursts in what is left, which no function of the state explains."""

from collections.abc import Collection, Mapping, Sequence, Set
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from identification.chain import Chain
from testbench.effects.external_contact import pushes, windows, withstood
from testbench.effects.logged import Logged

from ..fit.likelihood import SURELY, Weighed, odds
from ..fit.normal_equations import Fit, log_of_squares, squares, standard_values
from ..fit.score import Gain, Stage
from ..model.candidate import MOST_TORQUE, SATURATION, Candidate, Place
from ..model.candidates import in_parallel
from ..model.gram import Bank
from ..model.hypothesis import Design
from ..residual.unexplained import SMALLEST_SHARE as PREDICTED
from ..residual.unexplained import fitted_shares, predicted_shares

Array = NDArray[np.float64]

# Blocks of so many samples, and the share of them that a burst is in.
BURST, BURST_TIME = 20, 0.1
# Share of a joint's squared residual beyond noise that is in bursts, and that a push explains: more than any
# function of the motion fits.
SMALLEST_SHARE = 0.7
# Blocks of this share of the largest one's are of a burst: another run may be pushed a fifth as hard.
BURST_HEIGHT = 0.04
# And of so many times noise, which is what the block in the middle has.
BEYOND_NOISE = 8.0
# What a burst holds is this share of the joint's RMS torque over all the time.
BURST_TORQUE = 0.01
# s: what is shorter, the filter does not resolve: a shock of the reference, a sample that went astray.
SHORTEST = 0.12
# What by the weights of the hypothesis before gains less than this share of the most is not fitted in full.
WORTH_A_FIT = 0.5
# No push has a profile of ours to better than a tenth of its torque: its residual identifies no link.
PROFILE = 0.1
# Joints of whose bursts more than this share are at the same time bear the same push; by chance a tenth are.
TOGETHER = 0.25
# So many links from the last one on whose joint is seen to be loaded are considered.
LINKS = 4
# A push at random has no arm about a joint before its link, to what can be seen, about once in ten.
NO_ARM = 0.1


@dataclass(frozen=True)
class _Push:
    """A load on a link, and the hypothesis that has it, fitted in full.

    of_link: log-likelihood, but for what no profile of ours explains, which distinguishes no links.
    """

    weighed: Weighed
    trial: tuple[Design, Fit]
    of_link: float

    @property
    def score(self) -> float:
        """Log-likelihood that the push adds, less the price of its coefficients."""
        return self.weighed.score


def contact(
    stage: Stage, free: Bank
) -> tuple[Weighed, tuple[tuple[Weighed, float], ...], tuple[Design, Fit]] | None:
    """The link that was pushed, its rivals with their probabilities, and the hypothesis that has it.

    None where nothing looks like a push. An event cannot be predicted from other runs, so it is judged where
    it was seen, and pays for its coefficients instead (Akaike). free: candidates of generic.py; a joint whose
    residual one of them predicts was not pushed.
    """
    bursts, noise = _in_bursts(stage)
    predicted, fitted = predicted_shares(stage, free), fitted_shares(stage, free)
    # What a limit that clips softly leaves is in bursts, too.
    clipped = stage.hypothesis.joints_with(SATURATION)
    pushed = [
        j for j in bursts if predicted[j] < PREDICTED and fitted[j] < SMALLEST_SHARE and j not in clipped
    ]
    # So is what bristles leave that were bent when a run began.
    return None if stage.hypothesis.yielding.issuperset(pushed) else _likeliest(stage, pushed, bursts, noise)


def _likeliest(
    stage: Stage, pushed: Sequence[int], bursts: Mapping[int, set[tuple[int, int]]], noise: Array
) -> tuple[Weighed, tuple[tuple[Weighed, float], ...], tuple[Design, Fit]] | None:
    """The likeliest push that these joints bear, its rivals, and the fit, as of ``contact``.

    bursts, noise: as of ``_in_bursts``.
    """
    logged = _without_effects(stage)
    # A force loads the joints before its link, though perhaps with no arm on the last; others may shake.
    together = [j for j in pushed if _are_together(bursts[j], bursts[pushed[0]])]
    last = together[-1]
    blocks = set().union(*(bursts[j] for j in pushed))
    events = [_with_bursts(stage, index, windows(run, pushed), blocks) for index, run in enumerate(logged)]
    chain = stage.prepared.robot.chain
    further = [link for link in range(last + 1, chain.joints) if 0 < _beyond(chain, last, link) < LINKS]
    links = [*together, *further]
    # A link at a time: all columns of all of them together would fill a memory.
    gains = [
        gain
        for link in links
        for gain in _of_each_load(stage, in_parallel(stage.prepared, [partial(pushes, logged, link, events)]))
    ]
    # Of the drive's limit, where it has one: joints that do not move show nothing of what loads them.
    most = MOST_TORQUE * withstood([run.logged for run in stage.prepared.runs])
    likeliest: dict[int, _Push] = {}
    for gain in _worth_a_fit(gains):
        push, link = _fitted(stage, gain, noise, list(bursts)), gain.candidate.family.joint
        assert link is not None
        if push is None or not _is_bearable(push, most):
            continue
        if link not in likeliest or push.score > likeliest[link].score:
            likeliest[link] = push
    best = max((push.score for push in likeliest.values()), default=0.0)
    if best < SURELY:
        return None
    before = [NO_ARM ** len(set(chain.path(link)).difference(together)) for link in likeliest]
    probability = odds([push.of_link for push in likeliest.values()], best, before)
    ordered = sorted(zip(probability.tolist(), likeliest.values(), strict=True), key=lambda each: -each[0])
    _, first = ordered[0]
    return first.weighed, tuple((push.weighed, share) for share, push in ordered[1:]), first.trial


def _beyond(chain: Chain, link: int, further: int) -> int:
    """How many joints lie between a link and one further out on its branch; 0 on another branch."""
    path = chain.path(further)
    return len(path) - 1 - path.index(link) if link in path else 0


def is_in_bursts_at_several(stage: Stage) -> bool:
    """Whether the residual is in bursts at two joints or more, which hardly anything but a push explains.

    Bursts at one joint may come from anything that passes quickly.
    """
    bursts, _ = _in_bursts(stage)
    return len(bursts) > 1


def explains_all_bursts(stage: Stage, pushed: Fit) -> bool:
    """Whether a push explains all that is left in bursts."""
    bursts, noise = _in_bursts(stage)
    explained = _explained(squares(stage.fitted.residual), squares(pushed.residual), noise)
    return bool(np.all(explained[list(bursts)] > SMALLEST_SHARE))


def _are_together(one: Set[tuple[int, int]], other: Set[tuple[int, int]]) -> bool:
    """Whether bursts of two joints are of one push."""
    return len(one & other) > TOGETHER * min(len(one), len(other))


def _fitted(stage: Stage, gain: Gain, noise: Array, bursts: Sequence[int]) -> _Push | None:
    """A push fitted in full; None where it explains too little of every joint's bursts.

    noise: (n,) what of each joint's squared residual would be there without any burst.
    """
    before, trial = squares(stage.fitted.residual), stage.with_effects([gain.candidate])
    after, count = squares(trial[1].residual), gain.candidate.count
    if _explained(before, after, noise)[bursts].max() <= SMALLEST_SHARE:
        return None
    left, floor = (each / np.maximum(before, 1e-300) for each in (after, noise))
    of_profile = PROFILE**2 * np.maximum(1 - floor, 0.0)
    return _Push(
        Weighed(gain, log_of_squares(stage.independent, left) - count),
        trial,
        log_of_squares(stage.independent, left + of_profile) - count,
    )


def _explained(before: Array, after: Array, noise: Array) -> Array:
    """Share of each joint's squared residual beyond noise that a push explains, (n,)."""
    return (before - after) / np.maximum(before - noise, 1e-300)


def _of_each_load(stage: Stage, tried: Sequence[Candidate]) -> list[Gain]:
    """The likeliest profile of each kind of load on each link."""
    best: dict[tuple[Place, float], Gain] = {}
    for gain in stage.gains(Bank(stage.base, tried)):
        if gain is not None:
            load = gain.candidate.place, gain.candidate.member.shape["kind"]
            if load not in best or gain.objective > best[load].objective:
                best[load] = gain
    return list(best.values())


def _worth_a_fit(gains: Sequence[Gain]) -> list[Gain]:
    """Those that come near the likeliest of all."""
    worth = [0.5 * gain.objective - gain.candidate.count for gain in gains]
    least = WORTH_A_FIT * max(worth, default=0.0)
    return [gain for gain, own in zip(gains, worth, strict=True) if own >= least]


def _is_bearable(push: _Push, most: Array) -> bool:
    """Whether no joint is loaded with more than this, (n,) N·m."""
    member = push.weighed.candidate.member
    coefficients = push.trial[1].values[-member.count :]
    loads = (columns @ coefficients for columns in member.columns)
    return all(bool(np.all(np.abs(load) <= most[list(member.rows)])) for load in loads)


def _with_bursts(
    stage: Stage, index: int, events: list[tuple[int, int]], blocks: Collection[tuple[int, int]]
) -> list[tuple[int, int]]:
    """The windows of a run, long enough to be a push, that hold a block of a burst."""
    kept, rate = stage.prepared.runs[index].kept, stage.prepared.runs[index].logged.sample_rate
    events = [(first, last) for first, last in events if last - first > SHORTEST * rate]
    spans = [(kept[block], kept[block + BURST - 1]) for run, block in blocks if run == index]
    return [event for event in events if any(a < event[1] and event[0] <= b for a, b in spans)]


def _without_effects(stage: Stage) -> list[Logged]:
    """The runs less the torque of the accepted effects, with the parameters fitted together with them.

    So a push stands out, and nothing else does: where a joint's samples do not count, as near rest, its
    residual is made up from those before and after.
    """
    standard = standard_values(stage.prepared, stage.fitted.values)
    found = []
    for index, run in enumerate(stage.prepared.runs):
        tau = run.logged.tau.copy()
        for each, part in zip(stage.hypothesis.accepted, stage.hypothesis.parts, strict=True):
            tau -= each.member.spread(index, stage.prepared.joints) @ stage.fitted.values[part]
        logged = replace(run.logged, tau=tau, parameters=standard, carried=None, beside=None)
        found.append(_where_counted(logged, run.kept, stage.hypothesis.used[index]))
    return found


def _where_counted(logged: Logged, kept: NDArray[np.int64], used: NDArray[np.bool_]) -> Logged:
    """A run whose residual is made up where samples do not count. used: (M, n) of those kept."""
    residual, samples = logged.residual.copy(), np.arange(logged.samples)
    for joint, own in enumerate(used.T):
        counts = np.interp(samples, kept, own) > 0.5
        if counts.any():
            residual[~counts, joint] = np.interp(samples[~counts], samples[counts], residual[counts, joint])
    return replace(logged, tau=logged.predicted + residual)


def _in_bursts(stage: Stage) -> tuple[dict[int, set[tuple[int, int]]], Array]:
    """The joints at which a small part of the time holds most of the residual beyond noise, and no small one.

    And when: runs and numbers of the blocks that hold the most of it. With what of each joint's squared
    residual would be there without any burst, (n,).
    """
    found, noise = {}, squares(stage.fitted.residual)
    samples = sum(len(run) for run in stage.fitted.residual)
    for joint in range(stage.prepared.joints):
        blocks = _blocks(stage, joint)
        middle = float(np.median(list(blocks.values())))
        noise[joint] = min(middle * samples, noise[joint])
        largest = sorted(blocks, key=lambda place: -blocks[place])[: max(round(BURST_TIME * len(blocks)), 1)]
        burst = sum(blocks[place] - middle for place in largest)
        beyond = sum(blocks.values()) - middle * len(blocks)
        enough = (BURST_TORQUE * stage.base.torque_rms[joint]) ** 2 * len(blocks)
        least = max(BURST_HEIGHT * blocks[largest[0]], BEYOND_NOISE * middle)
        high = {place for place in largest if blocks[place] > least}
        if high and burst > max(SMALLEST_SHARE * beyond, enough):
            found[joint] = high
    return found, noise


def _blocks(stage: Stage, joint: int) -> dict[tuple[int, int], float]:
    """Mean square of a joint's residual in each block of the runs."""
    return {
        (run, first): float(np.mean(residual[first : first + BURST, joint] ** 2))
        for run, residual in enumerate(stage.fitted.residual)
        for first in range(0, len(residual) - BURST, BURST)
    }
