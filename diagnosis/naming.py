"""Whether what was taken in has a name: larger than on any healthy robot, and told from all else.

It is judged when it is taken in, and again where what was found later makes it seen more clearly.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from identification.parameters import OFFSET as OFFSET_TORQUE
from testbench.robot import Robot

from .accepted import COUPLING, Accepted
from .alone import OF_EVERY_JOINT, is_alone
from .candidates import SATURATION, Candidate
from .evidence import Fit, fitted_to, squares
from .findings import Gap
from .ground import Ground, ground
from .healthy import (
    CABLE,
    GAIN,
    OFFSET,
    WARMING,
    is_beyond_healthy,
    is_excessive,
    moves_little,
    times_healthy,
)
from .hypothesis import FEWEST_INDEPENDENT, FEWEST_OF_ALL, Design
from .likelihood import Weighed, gained, gained_by_shift
from .linearisation import TRANSMISSIONS
from .materiality import is_certainly_beyond, is_obvious
from .preparation import Prepared
from .prominence import is_main
from .round import Found
from .unclaimed import NOTHING, UNTOLD, Unclaimed
from .weighing import Gain, Stage

Array = NDArray[np.float64]

# A rival of this probability explains it as well.
AS_WELL = 0.25
# Share of a joint's squared residual that half the motion tells for sure.
NEARLY_ALL = 0.8
# Beside what no effect explains, one that takes off this share of it may be a trace of the same.
DWARFED = 0.05
# An effect that takes less than this share of its joint's gap off runs left out, where that gap and what all
# runs together fit are so many times the noise, is not the robot's. Nor are effects that take less than half
# of that off the gap of all joints, where it is farther from noise.
EXPLAINED, FAR_FROM_NOISE = 0.2, 3.0
EXPLAINED_OF_ALL, FARTHER_FROM_NOISE = 0.1, 4.0
# Nor are those that leave so many times the noise of it, where they close less than this share of what was
# beyond the noise, on runs left out and on all runs together: in 1320 cases those of seven robots of eight
# were wrong. A push leaves much where it acted otherwise, a gearbox that stiffens otherwise too.
LEFT_FAR_FROM_NOISE, MOSTLY_CLOSED = 4.5, 0.79
# Of a joint whose name does not hold, what is less than this share of its torque is nothing to explain.
LEAST_UNMET = 0.01
# Squared deviations from zero that are left at last, as what is taken in later may explain the same; a gain
# error told from three when it is taken in, as wrists' are, must be four from none.
AT_LAST, GAIN_AT_LAST = 9.0, 16.0
# Joints that move alike share what bristles leave: a drive that two share moves one of them by this share of
# its torque.
LEAST_COUPLED = 0.025
# Any joint warms, by this share of its friction in these runs; and whatever foretells less than this share of
# what its joint leaves is no cable.
WARMED, FORETOLD_BY_CABLE = 0.02, 0.1
# A push alone takes this share of the gap, or of some joint's that is so many times the noise: real ones
# three quarters, or all of a joint's.
OF_A_PUSH, OF_ITS_JOINT, BEYOND_NOISE = 0.55, 0.8, 1.3
# Effects without a name that take this share of a joint's torque, and of its gap, off runs left out are no
# healthy robot's imperfections, of which 140 took 5 % at most.
CLOSED_TORQUE, CLOSED_SHARE = 0.08, 0.5


def accepted_as(
    found: Found,
    stage: Stage,
    apart: Stage,
    sized: Robot,
    before: Sequence[Accepted],
    rest: Sequence[Weighed],
) -> Accepted:
    """What a round has found, and whether it has a name.

    apart: the stage before any effect of the joints. rest: what is left to explain beside it.
    """
    best, torque_rms = found.best, stage.ground.torque_rms
    own = best.candidate, found.trial[1].values[-best.candidate.count :]
    as_well = [(w.candidate, w.gain.coefficients) for w, p in found.rivals if p > AS_WELL]
    obvious = is_obvious(sized, stage, best.gain)
    alone = is_alone(sized, stage, best, own[1], before, rest)
    beyond = alone or is_beyond_healthy(sized, torque_rms, *own)
    # Where an imperfection of healthy size would explain it as well, nothing else need be there.
    beyond = beyond and all(is_beyond_healthy(sized, torque_rms, *each) for each in as_well)
    share = float(stage.shares(best.gain).max())
    beyond = (obvious or beyond) and not (is_excessive(sized, *own, share) or moves_little(torque_rms, *own))
    shift = gained_by_shift(stage, best.gain)
    beyond = beyond and couples(stage, best.gain) and warms(stage, *own)
    beyond = beyond and is_borne_out(best.candidate.family.effect, share, shift)
    # What a push leaves is where it was.
    firsts = [a.candidate for a in before if a.named and not a.candidate.is_event]
    main = alone or is_main(sized, apart, stage, best, firsts, rest)
    certain = found.is_certain(stage)
    samples = stage.independent[list(best.candidate.member.rows)]
    # Of an effect of the whole robot all joints tell.
    told = samples.max() if best.candidate.family.joint is not None else samples.sum()
    # Of what re-identification leaves: of what another effect leaves there, little is nearly all.
    large = obvious or is_certainly_beyond(sized, stage, best.gain)
    is_all = large and apart.shares(best.gain).max() > NEARLY_ALL
    enough = told >= (FEWEST_OF_ALL if is_all else FEWEST_INDEPENDENT)
    taken_off = np.maximum(stage.held_squares - squares(found.trial[1].held_out), 0)
    return Accepted(
        candidate=best.candidate,
        probability=1.0 - sum(p for _, p in found.rivals),
        rivals=found.rivals,
        score=best.score,
        share=share,
        worth=float(np.sum(taken_off / np.maximum(stage.counts, 1) / torque_rms**2)),
        shift=shift,
        named=bool(beyond and main and certain and enough),
        is_certain=certain,
        is_trace=found.is_trace,
        by_size=not (obvious or alone),
    )


def couples(stage: Stage, gain: Gain) -> bool:
    """Whether a shared drive moves either of its joints; whatever is none does."""
    moved = float(stage.torque_shares(gain).max())
    return gain.candidate.family.effect != COUPLING or moved > LEAST_COUPLED


def is_borne_out(name: str, share: float, shift: float) -> bool:
    """Whether an offset has bent the parameters, or a cable foretells something; what is neither need not.

    share: foretold of the rest. shift: log-likelihood that the parameters' shift spares with it.
    """
    if name == OFFSET:
        return shift >= 0
    return name != CABLE or share >= FORETOLD_BY_CABLE


def warms(stage: Stage, each: Candidate, coefficients: Array) -> bool:
    """Whether friction that warms falls in these runs, however much it would; whatever is none does.

    coefficients: (2,) of its viscous and Coulomb part.
    """
    joint = each.family.joint
    if each.family.effect != WARMING or joint is None:
        return True
    lost = np.concatenate([run[:, 0] @ coefficients for run in each.filtered])
    friction = [
        run.filtered(run.logged.friction[:, [joint]] - run.logged.table[joint, OFFSET_TORQUE], [joint])
        for run in stage.prepared.runs
    ]
    return bool(np.mean(lost**2) > WARMED**2 * np.mean(np.concatenate(friction) ** 2))


def judged_again(
    base: Ground, sized: Robot, accepted: Sequence[Accepted], rest: Sequence[Weighed]
) -> list[Accepted]:
    """What was taken in before a push, judged beside it: a push hides how much anything else explains.

    The push is the last one; limits are judged where they are sought. rest: as of ``accepted_as``.
    """
    found, apart = list(accepted), _of_robots(base, accepted)
    for place, item in enumerate(accepted[:-1]):
        if item.candidate.family.effect != SATURATION:
            found[place] = _judged_beside(apart, sized, found, place, rest)
    return found


def told_apart_at_last(
    last: Stage, sized: Robot, accepted: Sequence[Accepted], rest: Sequence[Weighed]
) -> list[Accepted]:
    """What was no larger than effects that were taken in after it, or not alone before, judged beside those.

    rest: as of ``accepted_as``.
    """
    base, values, found = last.ground, last.fitted.values, list(accepted)
    hidden = [
        place
        for place, (item, own) in enumerate(zip(accepted, last.hypothesis.parts, strict=True))
        if not (item.named or item.is_everywhere or item.is_trace)
        and item.is_certain
        and (
            item.candidate.family.effect in OF_EVERY_JOINT
            or is_beyond_healthy(sized, base.torque_rms, item.candidate, values[own])
        )
    ]
    apart = _of_robots(base, accepted) if hidden else last
    for place in hidden:
        again = _judged_beside(apart, sized, found, place, rest)
        if again.named:
            found[place] = again
    return found


def _of_robots(base: Ground, accepted: Sequence[Accepted]) -> Stage:
    """The stage with pushes and effects of the whole robot alone."""
    robots = [a.candidate for a in accepted if a.candidate.is_event or a.candidate.family.joint is None]
    return Stage.of(base, robots)


def _judged_beside(
    apart: Stage, sized: Robot, accepted: Sequence[Accepted], place: int, rest: Sequence[Weighed]
) -> Accepted:
    """One effect judged beside all others that were taken in. apart, rest: as of ``accepted_as``."""
    item, others, base = accepted[place], [*accepted[:place], *accepted[place + 1 :]], apart.ground
    stage = Stage(base, *without_one(base.prepared, accepted, place))
    gain = stage.gain(item.candidate)
    if gain is None:
        return item
    trial = stage.with_effects([item.candidate])
    gain = stage.as_fitted(gain, trial)
    best = Weighed(gain, gained(stage, gain))
    return accepted_as(Found(best, item.rivals, trial), stage, apart, sized, others, rest)


def without_one(prepared: Prepared, accepted: Sequence[Accepted], place: int) -> tuple[Design, Fit]:
    """The hypothesis without one of its effects, fitted in full."""
    return fitted_to(prepared, [a.candidate for k, a in enumerate(accepted) if k != place])


def as_fitted_at_last(
    sized: Robot, hypothesis: Design, fitted: Fit, accepted: Sequence[Accepted]
) -> list[Accepted]:
    """What was taken in with the shapes that all runs together give it.

    What no gear has loses its name, what is no larger then than on a healthy robot, and what is not told from
    none.
    """
    found, torque_rms = [], ground(hypothesis.prepared).torque_rms
    for item, part, candidate in zip(accepted, hypothesis.parts, hypothesis.accepted, strict=True):
        own = candidate, fitted.values[part]
        named = item.named and not is_excessive(sized, *own, item.share)
        named = named and (not item.by_size or times_healthy(sized, torque_rms, *own) > 1)
        least = GAIN_AT_LAST if candidate.family.effect == GAIN else AT_LAST
        # A limit that the drive reports leaves no gap, and a push is told by when it was.
        elsewhere = candidate.is_event or candidate.family.effect == SATURATION
        named = named and (elsewhere or fitted.wald(part) > least)
        found.append(replace(item, candidate=candidate, named=named))
    return found


def is_dwarfed(item: Accepted, unknown: Sequence[Unclaimed], last: Stage) -> bool:
    """Whether what no effect explains is at its joint, which a name would only imitate, or far larger."""
    misfit = [each.joint for each in unknown]
    left = last.held_squares / np.maximum(last.counts, 1) / last.ground.torque_rms**2
    largest = float(np.max(left[misfit], initial=0.0))
    return item.candidate.family.joint in misfit or item.worth < DWARFED * largest


def names_that_hold(
    accepted: Sequence[Accepted], gap: Gap, fitted: Array, torque: Array
) -> tuple[tuple[Accepted, ...], tuple[Unclaimed, ...]]:
    """What was taken in, without the names that leave too much of their joints' gap, or of all; those joints.

    gap: on whole runs left out. fitted, torque: (n,) N·m RMS, what all runs fitted together leave, and of the
    joints. What only one run tells may leave the gap of that run as it was, but not what all of them fit.
    What re-identification swallows never seemed to explain it. A push of such a joint is a rest of it.
    """
    closed, reducible = gap.parameters - gap.effects, gap.parameters - gap.noise_floor
    is_far = np.minimum(gap.parameters, fitted) > FAR_FROM_NOISE * gap.noise_floor
    leaves_too_much = is_far & (closed < EXPLAINED * reducible)
    if gap.parameters.sum() > FARTHER_FROM_NOISE * gap.noise_floor.sum():
        leaves_too_much |= bool(closed.sum() < EXPLAINED_OF_ALL * reducible.sum())
    pushed = any(item.named and item.candidate.is_event for item in accepted)
    stays_far = _stays_far(gap, fitted, torque) & (not pushed)
    left = np.minimum(gap.effects / np.maximum(gap.parameters, 1e-300), 1.0) ** 2
    found, nearest = [], dict[int, str]()
    for item in accepted:
        joint = item.candidate.family.joint
        seems = item.named and item.share > EXPLAINED and not item.candidate.is_event
        is_gearbox = item.candidate.family.effect in TRANSMISSIONS
        if seems and joint is not None and (leaves_too_much[joint] or (stays_far[joint] and not is_gearbox)):
            item = replace(item, named=False)
            nearest.setdefault(joint, item.candidate.family.effect)
        found.append(item)
    # A push there was found in what such an effect had left.
    is_rest = [item.candidate.is_event and item.candidate.family.joint in nearest for item in found]
    kept = tuple(
        replace(item, named=item.named and not rest) for item, rest in zip(found, is_rest, strict=True)
    )
    unmet = [joint for joint in sorted(nearest) if gap.effects[joint] > LEAST_UNMET * torque[joint]]
    return kept, tuple(
        Unclaimed(joint, NOTHING, float(left[joint]), nearest=nearest[joint]) for joint in unmet
    )


def _stays_far(gap: Gap, fitted: Array, torque: Array) -> NDArray[np.bool_]:
    """The joints (n,) whose gap stays far from noise, too little of it closed; arguments as above."""
    closed, reducible = gap.parameters - np.minimum(gap.effects, fitted), gap.parameters - gap.noise_floor
    is_far = gap.effects > np.maximum(LEFT_FAR_FROM_NOISE * gap.noise_floor, LEAST_UNMET * torque)
    is_misfit = fitted > FAR_FROM_NOISE * gap.noise_floor
    return is_far & is_misfit & (closed < MOSTLY_CLOSED * reducible)


def pushes_that_hold(
    accepted: Sequence[Accepted], gap: Gap
) -> tuple[tuple[Accepted, ...], tuple[Unclaimed, ...]]:
    """What was taken in, without the names of pushes where no other has one and half of the gap is left.

    And some of every joint's; and their joints, as what acts in bursts there is not the surroundings. gap: on
    whole runs left out.
    """
    named = [item for item in accepted if item.named]
    is_far = gap.parameters > BEYOND_NOISE * gap.noise_floor
    closed = np.array([gap.closed_at(joint) or 0.0 for joint in range(len(is_far))])
    holds = gap.closed is None or gap.closed > OF_A_PUSH or np.any(closed[is_far] > OF_ITS_JOINT)
    if not named or holds or not all(item.candidate.is_event for item in named):
        return tuple(accepted), ()
    joints = {item.candidate.family.joint for item in named}
    left = np.minimum(gap.effects / np.maximum(gap.parameters, 1e-300), 1.0) ** 2
    return tuple(replace(item, named=False) for item in accepted), tuple(
        Unclaimed(joint, NOTHING, float(left[joint])) for joint in sorted(j for j in joints if j is not None)
    )


def closed_without_a_name(accepted: Sequence[Accepted], gap: Gap, torque: Array) -> tuple[Unclaimed, ...]:
    """The joints whose gap effects without a name close, where none has one: what acts there is not told.

    What other joints have alike is told as that. gap, torque: as of ``names_that_hold``.
    """
    if any(item.named for item in accepted):
        return ()
    closed = np.maximum(gap.parameters**2 - gap.effects**2, 0.0)
    share = closed / np.maximum(gap.parameters**2, np.finfo(float).tiny)
    much = (closed > (CLOSED_TORQUE * torque) ** 2) & (share > CLOSED_SHARE)
    alike = {item.candidate.family.joint for item in accepted if item.is_everywhere}
    joints = [joint for joint in np.flatnonzero(much).tolist() if joint not in alike]
    return tuple(Unclaimed(joint, UNTOLD, float(share[joint])) for joint in joints)
