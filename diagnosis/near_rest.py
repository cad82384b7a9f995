"""Friction that is soft near rest: read from what a hypothesis leaves, and no effect of any joint's own.

Near rest no joint has all of its Coulomb friction: bristles bend, grease creeps, encoders count, and who
simulates smooths the jump: fc tanh(v / w) in place of fc sgn v. Taken for a jump, what is missing there looks
like friction that bends at any speed. Where the smooth form explains more than any effect of the joint, it
is the joint's Coulomb friction.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from identification.parameters import COULOMB, PER_JOINT
from testbench.effects.signature import Family, Member, single_joint

from .candidates import Candidate, candidate
from .evidence import standard_values
from .generic import no_parameters
from .likelihood import Weighed, gained
from .materiality import BRISTLES
from .preparation import Prepared
from .weighing import Bank, Stage

Array = NDArray[np.float64]

# rad/s (m/s): widths w that are tried, how far apart they are, and how well one is told from there.
WIDTHS = (0.015, 0.025, 0.04, 0.065, 0.1, 0.16)
APART, TOLERANCE = 1.6, 0.02
# The form is a guess: up to so many widths, samples say nothing; where too few would be left, up to fewer.
GUESSED = (2.5, 1.5)
# Log-likelihood that it must gain, and the share of the Coulomb friction that must be missing near rest.
SMALLEST_GAIN, SMALLEST_MISSING = 8.0, 0.3
# And how much more than any effect of the joint it must explain: friction of real joints bends too.
MORE = 1.3
# And the share of the joint's samples that must be left.
FEWEST = 0.25


def soft_candidates(prepared: Prepared) -> list[Candidate]:
    """What smoothing takes off a unit of each Coulomb friction, at every width that leaves enough samples."""
    return [
        _missing(prepared, joint, width)
        for joint, known in enumerate(prepared.coulomb_smoothing)
        for width in WIDTHS
        if width > APART * known and _slowest(prepared, joint, width) is not None
    ]


def soft_near_rest(stage: Stage, weighed: Sequence[Weighed], soft: Bank) -> dict[int, float]:
    """The joints whose friction is soft near rest, softer than is known, and its width w, rad/s (m/s).

    weighed: what each effect of the catalogue explains beside the stage's. soft: of ``soft_candidates``.
    """
    prepared = stage.prepared
    least = np.full(prepared.joints, SMALLEST_GAIN)
    for rival in weighed:
        if (joint := rival.candidate.family.joint) is not None:
            least[joint] = max(least[joint], MORE * rival.score)
    # Bristles are soft near rest in their own way.
    bristled = {c.family.joint for c in stage.hypothesis.accepted if c.family.effect == BRISTLES}
    coulomb = standard_values(prepared, stage.fitted.values).reshape(-1, PER_JOINT)[:, COULOMB]
    found: dict[int, float] = {}
    for each, gain in zip(soft.candidates, stage.gains(soft), strict=True):
        joint = each.family.joint
        assert joint is not None
        if gain is None or joint in bristled or gain.coefficients[0] < SMALLEST_MISSING * coulomb[joint]:
            continue
        if (score := gained(stage, gain)) > least[joint]:
            least[joint], found[joint] = score, each.member.shape["width"]
    return {joint: _refined(stage, joint, width) for joint, width in found.items()}


def with_soft_friction(prepared: Prepared, widths: Mapping[int, float]) -> Prepared:
    """The runs with smooth Coulomb friction at these joints, less what is too slow for its form to tell."""
    if not widths:
        return prepared
    smoothing = prepared.coulomb_smoothing.copy()
    smoothing[list(widths)] = list(widths.values())
    slowest = {
        joint: _slowest(prepared, joint, width) or GUESSED[-1] * width for joint, width in widths.items()
    }
    runs = []
    for run in prepared.runs:
        used, rows = run.used.copy(), run.rows.copy()
        logged = replace(run.logged, coulomb_smoothing=smoothing)
        for joint, speed in slowest.items():
            soft = run.filtered(logged.direction[:, [joint]], [joint])
            rows[:, joint, PER_JOINT * joint + COULOMB] = soft[:, 0]
            used[:, joint] &= run.away_from(joint, speed)
        runs.append(replace(run, logged=logged, used=used, rows=rows))
    return replace(prepared, runs=tuple(runs))


def _slowest(prepared: Prepared, joint: int, width: float) -> float | None:
    """The speed, rad/s (m/s), from which samples count at a width; None where too few would be left."""
    used = np.concatenate([run.used[:, joint] for run in prepared.runs])
    for widths in GUESSED:
        away = np.concatenate([run.away_from(joint, widths * width) for run in prepared.runs])
        if np.sum(used & away) > FEWEST * np.sum(used):
            return widths * width
    return None


def _refined(stage: Stage, joint: int, width: float) -> float:
    """The likeliest width between the neighbours of one that was tried."""

    def negative(logarithm: float) -> float:
        gain = stage.gain(_missing(stage.prepared, joint, float(np.exp(logarithm))))
        return 0.0 if gain is None else -gained(stage, gain)

    bounds = np.log(width / APART), np.log(width * APART)
    best = minimize_scalar(negative, bounds=bounds, method="bounded", options={"xatol": TOLERANCE})
    return float(np.exp(best.x))


def _missing(prepared: Prepared, joint: int, width: float) -> Candidate:
    """What smoothing takes off a unit of a joint's Coulomb friction."""
    columns = []
    for run in prepared.runs:
        v = run.logged.dq[:, joint]
        columns.append((np.tanh(v / width) - np.sign(v))[:, None])
    member = Member({"width": width}, (joint,), single_joint(columns), np.zeros(1), np.full(1, np.inf))
    return candidate(prepared, Family("soft friction", joint, (member,), no_parameters), member)
