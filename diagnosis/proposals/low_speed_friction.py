"""Friction that is soft near rest: read from what a hypothesis leaves, and no effect of any joint's own.

Near rest no joint has all of its Coulomb friction: bristles bend, grease creeps, encoders count, and who
simulates smooths the jump: fc tanh(v / w) in place of fc sgn v. Taken for a jump, what is missing there looks
like friction that bends at any speed. Where the smooth form explains more than any effect of the joint, it
is the joint's Coulomb friction.

And a simulator whose friction is a soft constraint, as MuJoCo's frictionloss, turns it when v + l a changes
sign: l = time constant x impedance / 2 ahead of the joint, 9.5 ms by default. It is estimated from all
joints together.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from identification.parameters import COULOMB, PER_JOINT
from testbench.effects.columns import on_one_joint
from testbench.effects.signature import Logged

from ..data.run import DEAD_ZONE, Prepared
from ..fit.likelihood import SURELY, Weighed, gained, gained_by_shift
from ..fit.normal_equations import standard_values
from ..fit.score import Stage
from ..model.candidate import Candidate
from ..model.candidates import without_law
from ..model.gram import Bank
from .standing_drive import FEWEST, apart_from_standing, standing_drives

Array = NDArray[np.float64]

# Widths w, rad/s (m/s), and leads l, s, that are tried, each so many times the one before.
TIMES = 1.6
WIDTHS, LEADS = (0.015 * TIMES ** np.arange(6)).tolist(), (0.004 * TIMES ** np.arange(4)).tolist()
# How precisely the logarithm of one is found from there.
TOLERANCE = 0.02
# The form is a guess: up to so many widths, samples say nothing.
GUESSED = 2.5
# Share of the Coulomb friction that must be missing near rest, and that must turn early: where a joint sticks
# at each reversal, half of it seems to.
SMALLEST_MISSING, SMALLEST_LEADING = 0.3, 0.6
# How much more than any effect of the joint it must explain: friction of real joints bends too.
MORE = 1.3
# Of so many joints, where there are as many, friction turns early: it is the simulator's, not a joint's.
LEADING = 2


@dataclass(frozen=True)
class NearRest:
    """Coulomb friction fc tanh((v + l a) / w) of every joint.

    widths: w of the joints that are soft, rad/s (m/s). lead: l of all, s. standing: pairs of joints whose
    shared drive stands still at times.
    """

    widths: Mapping[int, float] = field(default_factory=dict)
    lead: float = 0.0
    standing: frozenset[tuple[int, int]] = frozenset()


def lead_candidates(prepared: Prepared) -> list[Candidate]:
    """Candidates for Coulomb friction that reverses ahead of each joint; none where the lead is known."""
    if prepared.coulomb_lead > 0:
        return []
    joints = range(prepared.joints)
    # A simulator turns it within a narrow width, or at once.
    return [_ahead(prepared, j, lead, width) for j in joints for lead in LEADS for width in (0.0, WIDTHS[0])]


def soft_candidates(prepared: Prepared) -> list[Candidate]:
    """Candidates for Coulomb friction smoothed near rest, at each joint and width that has enough samples."""
    return [
        _missing(prepared, joint, width)
        for joint, known in enumerate(prepared.coulomb_smoothing)
        for width in WIDTHS
        if width > TIMES * known and _has_enough_above(prepared, joint, GUESSED * width)
    ]


def near_rest(stage: Stage, weighed: Sequence[Weighed], ahead: Bank, soft: Bank) -> NearRest | None:
    """Friction near rest that the runs show beyond the known: lead, widths, standing drives; or None.

    weighed: gain of each catalogue effect over the stage's. ahead, soft: of ``lead_candidates`` and
    ``soft_candidates``.
    """
    least = np.full(stage.prepared.joints, SURELY)
    for rival in weighed:
        if (joint := rival.candidate.family.joint) is not None:
            least[joint] = max(least[joint], MORE * rival.score)
    # A delay that the timing of the log only makes up for is none.
    of_all = [
        rival.score
        for rival in weighed
        if rival.candidate.family.joint is None and gained_by_shift(stage, rival.gain) >= 0
    ]
    lead = _leading(stage, least, MORE * max(of_all, default=0.0), ahead)
    if lead > 0:
        # The width of the reversal is found once its time is known.
        return NearRest({}, lead, standing=stage.prepared.standing)
    known = {int(j): float(w) for j, w in enumerate(stage.prepared.coulomb_smoothing) if w > 0}
    widths, standing = _soft(stage, least, soft), standing_drives(stage)
    if not widths and not standing:
        return None
    return NearRest(known | widths, stage.prepared.coulomb_lead, stage.prepared.standing | standing)


def _leading(stage: Stage, least: Array, least_of_all: float, ahead: Bank) -> float:
    """Seconds by which the friction of all joints turns ahead of them; 0 where too few do, or hardly."""
    coulomb = _coulomb(stage)
    explained, widths = np.zeros((2, len(LEADS), len(coulomb)))
    for each, gain in zip(ahead.candidates, stage.gains(ahead), strict=True):
        joint, shape = each.family.joint, each.member.shape
        assert joint is not None
        if gain is None or gain.coefficients[0] < SMALLEST_LEADING * coulomb[joint]:
            continue
        place = LEADS.index(shape["lead"]), joint
        if (score := gained(stage, gain)) > explained[place]:
            explained[place], widths[place] = score, shape["width"]
    leading = np.flatnonzero(explained.max(axis=0) > least)
    together = explained[:, leading].sum(axis=1)
    best = int(together.argmax())
    if len(leading) < min(LEADING, len(coulomb)) or together[best] <= least_of_all:
        return 0.0

    def negative(lead: float) -> float:
        tried = [_ahead(stage.prepared, int(j), lead, float(widths[best, j])) for j in leading]
        return -sum(gained(stage, gain) for gain in map(stage.gain, tried) if gain is not None)

    return _likeliest(negative, LEADS[best])


def _soft(stage: Stage, least: Array, soft: Bank) -> dict[int, float]:
    """The joints whose friction is soft near rest, softer than is known, and its width w, rad/s (m/s)."""
    # Bristles are soft near rest in their own way.
    bristled = stage.hypothesis.yielding
    coulomb, least = _coulomb(stage), least.copy()
    found: dict[int, float] = {}
    for each, gain in zip(soft.candidates, stage.gains(soft), strict=True):
        joint = each.family.joint
        assert joint is not None
        if gain is None or joint in bristled or gain.coefficients[0] < SMALLEST_MISSING * coulomb[joint]:
            continue
        if (score := gained(stage, gain)) > least[joint]:
            least[joint], found[joint] = score, each.member.shape["width"]

    def negative(joint: int) -> Callable[[float], float]:
        def of_width(width: float) -> float:
            gain = stage.gain(_missing(stage.prepared, joint, width))
            return 0.0 if gain is None else -gained(stage, gain)

        return of_width

    return {joint: _likeliest(negative(joint), width) for joint, width in found.items()}


def _coulomb(stage: Stage) -> Array:
    """(n,) N·m of Coulomb friction as fitted."""
    return standard_values(stage.prepared, stage.fitted.values).reshape(-1, PER_JOINT)[
        : stage.prepared.joints, COULOMB
    ]


def with_friction_near_rest(prepared: Prepared, known: NearRest) -> Prepared:
    """The runs with such Coulomb friction, less what is too slow for its form to be known."""
    if known == NearRest():
        return prepared
    smoothing = np.zeros(prepared.joints)
    smoothing[list(known.widths)] = list(known.widths.values())
    turned = [
        replace(run, logged=replace(run.logged, coulomb_smoothing=smoothing, coulomb_lead=known.lead))
        for run in prepared.runs
    ]
    prepared = replace(prepared, runs=tuple(turned))
    joints = range(prepared.joints) if known.lead else known.widths
    runs = []
    for run in prepared.runs:
        used, rows = run.used.copy(), list(run.rows)
        for joint in joints:
            share = run.filtered(run.logged.direction[:, [joint]], [joint])
            rows[joint] = run.rows[joint].copy()
            rows[joint][:, COULOMB] = share[:, 0]
            used[:, joint] &= run.away_from(joint, max(GUESSED * smoothing[joint], DEAD_ZONE))
        for pair in known.standing:
            used[:, pair] &= apart_from_standing(run, pair)
        runs.append(replace(run, used=used, rows=tuple(rows)))
    return replace(prepared, runs=tuple(runs), standing=known.standing)


def _has_enough_above(prepared: Prepared, joint: int, speed: float) -> bool:
    """Whether enough of a joint's samples are left above a speed, rad/s (m/s)."""
    used = np.concatenate([run.used[:, joint] for run in prepared.runs])
    away = np.concatenate([run.away_from(joint, speed) for run in prepared.runs])
    return bool(np.sum(used & away) > FEWEST * np.sum(used))


def _likeliest(negative: Callable[[float], float], tried: float) -> float:
    """The minimum between the neighbours of a value that was tried."""
    bounds = np.log(tried / TIMES), np.log(tried * TIMES)
    best = minimize_scalar(
        lambda logarithm: negative(float(np.exp(logarithm))),
        bounds=bounds,
        method="bounded",
        options={"xatol": TOLERANCE},
    )
    return float(np.exp(best.x))


def _missing(prepared: Prepared, joint: int, width: float) -> Candidate:
    """Candidate: change of a joint's unit Coulomb friction when it is smoothed over a width of speed."""
    return _changed(prepared, joint, {"width": width}, lambda run: np.tanh(run.turning[:, joint] / width))


def _ahead(prepared: Prepared, joint: int, lead: float, width: float) -> Candidate:
    """Candidate: change of a joint's unit Coulomb friction when it reverses ``lead`` seconds ahead."""

    def turned(run: Logged) -> Array:
        turning = run.dq[:, joint] + lead * run.ddq[:, joint]
        return np.tanh(turning / width) if width > 0 else np.sign(turning)

    return _changed(prepared, joint, {"lead": lead, "width": width}, turned)


def _changed(
    prepared: Prepared, joint: int, shape: dict[str, float], turned: Callable[[Logged], Array]
) -> Candidate:
    """A share (N,) of a joint's Coulomb friction in place of the sign that the friction turns with."""
    columns = on_one_joint(
        [run.logged for run in prepared.runs],
        lambda run: (turned(run) - np.sign(run.turning[:, joint]))[:, None],
    )
    return without_law(prepared, "friction near rest", joint, columns, np.zeros(1), shape)
