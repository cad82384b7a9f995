"""Structure that the hypothesis leaves: where a free function of the motion explains what no effect does."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .candidates import FREE
from .evidence import squares
from .generic import RUN_TIME
from .likelihood import weigh
from .noise import noise_rms
from .spectrum import slow_share
from .weighing import Bank, Gain, Stage

Array = NDArray[np.float64]

# A free function counts where it removes this share of what is left of the joint's squared residual and this
# share of its RMS torque ...
SMALLEST_SHARE, SMALLEST_TORQUE = 0.25, 0.015
# ... and that is this share of what re-identification left, and of what the effects taken in explain there.
SHARE_OF_GAP, SHARE_OF_EXPLAINED = 0.15, 0.5

# What is left counts without any function to follow where it is this share of the joint's RMS torque, so many
# times the noise, and this share of what re-identification left.
MISFIT_TORQUE, MISFIT_NOISE, MISFIT_LEFT = 0.1, 3.0, 0.5
# So does what is this share of the joint's torque, so many times what the joint in the middle of all has, not
# noise, and this share of what re-identification left: a law that is nearly the robot's leaves less, and a
# spring's next to nothing.
STANDING_OUT_TORQUE, STANDING_OUT, STANDING_OUT_LEFT, SPRING_LEFT = 0.03, 3.0, 0.37, 0.12
SPRINGS = {"gravity_spring", "cable_spring"}
NOTHING = "nothing that was tried"


@dataclass(frozen=True)
class Unclaimed:
    """A joint's index, the regime in words, and the share of its gap that follows it."""

    joint: int
    regime: str
    share: float


def foretold_shares(stage: Stage, free: Bank) -> Array:
    """Largest share of each joint's held-out squared residual that a function of the motion removes, (n,).

    Functions of the run's time are left out: what happens at an instant is no function of the motion.
    """
    return np.max([np.zeros(stage.prepared.joints), *map(stage.shares, _of_motion(stage, free))], axis=0)


def fitted_shares(stage: Stage, free: Bank) -> Array:
    """Largest share of each joint's squared residual that a function of the motion fits, (n,): not foretold.

    Functions of the run's time are left out, as above.
    """
    residual = stage.weights * squares(stage.fitted.residual)
    found = np.zeros(stage.prepared.joints)
    for gain in _of_motion(stage, free):
        joint = list(gain.candidate.member.rows)
        found[joint] = np.maximum(found[joint], gain.objective / np.maximum(residual[joint], 1e-300))
    return found


def _of_motion(stage: Stage, free: Bank) -> list[Gain]:
    """What the free functions gain, but for those of the run's time."""
    gains = [gain for gain in stage.gains(free) if gain is not None]
    return [gain for gain in gains if gain.candidate.family.effect != FREE + RUN_TIME]


def unclaimed(first: Stage, last: Stage, free: Bank) -> tuple[Unclaimed, ...]:
    """The joints at which a function free of any law explains what the hypothesis does not, largest first.

    first: re-identification alone. last: with all effects taken in. free: candidates of generic.py.
    """
    explained = first.held_squares - last.held_squares
    found: dict[int, Unclaimed] = {}
    for weighed in weigh(last, free):
        joint = weighed.candidate.family.joint
        assert joint is not None
        more = float(weighed.gain.held_out[joint])
        if last.shares(weighed.gain)[joint] < SMALLEST_SHARE:
            continue
        if last.removed(weighed.gain)[joint] < SMALLEST_TORQUE * last.ground.torque_rms[joint]:
            continue
        if more < SHARE_OF_GAP * first.held_squares[joint] or more < SHARE_OF_EXPLAINED * explained[joint]:
            continue
        share = more / float(first.held_squares[joint])
        if joint not in found or share > found[joint].share:
            regime = weighed.candidate.family.effect.removeprefix(FREE)
            found[joint] = Unclaimed(joint, regime, share)
    rms = np.sqrt(last.held_squares / np.maximum(last.counts, 1))
    relative, noise = rms / last.ground.torque_rms, rms / noise_rms(last.prepared)
    unfit = (relative > MISFIT_TORQUE) & (noise > MISFIT_NOISE)
    left = last.held_squares / np.maximum(first.held_squares, 1e-300)
    unfit &= left > MISFIT_LEFT
    stands_out = (relative > STANDING_OUT_TORQUE) & (relative > STANDING_OUT * np.median(relative))
    sprung = {each.family.joint for each in last.hypothesis.accepted if each.family.effect in SPRINGS}
    most = np.where([joint in sprung for joint in range(len(left))], SPRING_LEFT, STANDING_OUT_LEFT)
    for joint in np.flatnonzero(stands_out & (left > most)).tolist():
        unfit[joint] |= _is_slow(last, joint)
    for joint in np.flatnonzero(unfit).tolist():
        found.setdefault(joint, Unclaimed(joint, NOTHING, min(float(left[joint]), 1.0)))
    return tuple(sorted(found.values(), key=lambda item: -item.share))


def _is_slow(stage: Stage, joint: int) -> bool:
    """Whether a joint's residual lies where motion does, by more than half of what noise would not."""
    fitted, used = stage.fitted, stage.hypothesis.used
    residual = [run[:, joint] for run in fitted.held_out]
    share, expected = slow_share(stage.prepared.runs, joint, residual, [run[:, joint] for run in used])
    return share > (1 + expected) / 2
