"""Structure that the hypothesis leaves: where a free function of the motion explains what no effect does."""

from collections.abc import Collection, Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..fit.likelihood import weigh
from ..fit.normal_equations import fit, is_extrapolated, squares
from ..fit.score import Gain, Stage
from ..model.candidate import FREE
from ..model.free_functions import RUN_TIME
from ..model.gram import Bank
from ..model.hypothesis import LATE, design
from .localisation import DENSE, regime_shares, share_left
from .noise import noise
from .shares import NOTHING, RegimeShare, Unclaimed
from .spectrum import PERIODIC, slow_share

Array = NDArray[np.float64]

# A free function counts where it removes this share of what is left of the joint's squared residual and this
# share of its RMS torque, and half of what the accepted effects explain there.
SMALLEST_SHARE, SMALLEST_TORQUE, MOST = 0.25, 0.015, 0.5
# A residual that follows no function counts from this share of the joint's RMS torque (a healthy joint leaves
# one or two per cent), this multiple of the noise, and this share of what re-identification left. Where the
# noise is not known, most of what re-identification left must be there, and most of that must be slow.
MISFIT_TORQUE, MISFIT_NOISE, MISFIT_LEFT = 0.03, 6.0, 0.15
# At a joint with a named effect any share of the torque counts. If the effect leaves most of the residual, so
# does this multiple of the noise: its law is then not the joint's.
NAMED_NOISE = 3.0
# The regime of torque that is logged late.
TIMING = "rate of torque"


def predicted_shares(stage: Stage, free: Bank) -> Array:
    """Largest share of each joint's held-out squared residual that a function of the motion removes, (n,).

    Functions of the run's time are left out: what happens at an instant is no function of the motion.
    """
    return np.max([np.zeros(stage.prepared.joints), *map(stage.shares, _of_motion(stage, free))], axis=0)


def fitted_shares(stage: Stage, free: Bank) -> Array:
    """Largest share of each joint's squared residual that a function of the motion fits, (n,), not held-out.

    Functions of the run's time are left out, as above.
    """
    residual = stage.weights * squares(stage.fitted.residual)
    found = np.zeros(stage.prepared.joints)
    for gain in _of_motion(stage, free):
        joint = list(gain.candidate.member.rows)
        found[joint] = np.maximum(found[joint], gain.objective / np.maximum(residual[joint], 1e-300))
    return found


def _of_motion(stage: Stage, free: Bank) -> list[Gain]:
    """Gains of the free functions of the motion, without those of the run's time."""
    gains = [gain for gain in stage.gains(free) if gain is not None]
    return [gain for gain in gains if gain.candidate.family.effect != FREE + RUN_TIME]


def unclaimed(first: Stage, last: Stage, free: Bank, named: Collection[int] = ()) -> tuple[Unclaimed, ...]:
    """Unexplained residuals of the joints, found by functions of the motion free of any law; largest first.

    first: re-identification, without effects. last: with all accepted effects. free: candidates of
    free_functions.py. named: joints with an effect that may be reported.
    """
    found: dict[int, Unclaimed] = {}
    for each in (*_of_free_functions(first, last, free), *_of_periods(first, last), *_of_timing(last)):
        if each.joint not in found or each.share > found[each.joint].share:
            found[each.joint] = each
    for each in _of_nothing(first, last, named):
        found.setdefault(each.joint, each)
    known = [each for each in found.values() if last.hypothesis.has_enough_samples[each.joint]]
    return tuple(sorted(known, key=lambda item: -item.share))


def _of_free_functions(first: Stage, last: Stage, free: Bank) -> Iterator[Unclaimed]:
    """Unexplained residual that smooth functions of the motion predict, of each joint."""
    for weighed in weigh(last, free):
        joint = weighed.candidate.family.joint
        assert joint is not None
        # By Akaike's criterion: where parameters are extrapolated, one of run time may predict by chance.
        if weighed.gain.wald < 2 * weighed.candidate.count:
            continue
        regime = weighed.candidate.family.effect.removeprefix(FREE)
        yield from _if_enough(first, last, joint, regime, float(weighed.gain.held_out[joint]))


def _of_periods(first: Stage, last: Stage) -> Iterator[Unclaimed]:
    """Unexplained residual that is periodic in the position, too often for a smooth function."""
    for joint in np.flatnonzero(_relative(last) > SMALLEST_TORQUE).tolist():
        if (period := _period(last, joint)) is not None:
            more = period.share * float(last.held_squares[joint])
            yield from _if_enough(first, last, joint, period.regime, more)


def with_its_period(last: Stage, item: Unclaimed) -> Unclaimed:
    """The unexplained residual with the period in position that much of it has, where no other pattern fits.

    last: with all accepted effects.
    """
    if item.regime != NOTHING or item.frequency is not None:
        return item
    period = _period(last, item.joint)
    if period is None or period.share <= SMALLEST_SHARE:
        return item
    return replace(item, period=period.regime)


def _period(last: Stage, joint: int) -> RegimeShare | None:
    """The strongest period of what is left of a joint, if chance gives none as strong."""
    shares = regime_shares(last.prepared, last.fitted.held_out, last.hypothesis.used, joint)
    periods = (each for each in shares if each.aspect == PERIODIC)
    return next((each for each in periods if each.concentration >= DENSE), None)


def _if_enough(first: Stage, last: Stage, joint: int, regime: str, more: float) -> Iterator[Unclaimed]:
    """A joint's regime, if a function of it explains enough. more: its held-out squares that it removes."""
    explained = float(first.held_squares[joint] - last.held_squares[joint])
    torque = np.sqrt(max(more, 0.0) / max(float(last.counts[joint]), 1.0))
    if (
        more >= SMALLEST_SHARE * last.held_squares[joint]
        and torque >= SMALLEST_TORQUE * last.base.torque_rms[joint]
        and more >= MOST * explained
    ):
        yield Unclaimed(joint, regime, more / float(first.held_squares[joint]))


def _of_timing(last: Stage) -> Iterator[Unclaimed]:
    """Residual explained by a common delay longer than that between sampling of torque and of position.

    Torque that is logged late, through a filter, is the log's, not the robot's.
    """
    hypothesis = last.hypothesis
    delayed = any(each.is_common_delay for each in hypothesis.accepted)
    if delayed or last.timing > -LATE:
        return
    in_time = squares(fit(design(last.base, hypothesis.accepted, is_delayed=True)).held_out)
    share = 1 - last.held_squares / np.maximum(in_time, 1e-300)
    joint = int(np.argmax(share))
    yield Unclaimed(joint, TIMING, float(share[joint]))


def _of_nothing(first: Stage, last: Stage, named: Collection[int]) -> Iterator[Unclaimed]:
    """Unexplained residual too large for noise that follows neither the motion nor a period."""
    of_sensors, left = noise(last.base), share_left(first, last)
    has_name = np.isin(np.arange(len(left)), list(named))
    times, is_large = _rms(last) / of_sensors.rms, _relative(last) > MISFIT_TORQUE
    is_loud = of_sensors.seen & (times > MISFIT_NOISE)
    is_misfit = is_loud & (has_name | is_large) & (left > MISFIT_LEFT)
    is_misfit |= has_name & (~of_sensors.seen | (times > NAMED_NOISE)) & (left > MOST)
    for joint in np.flatnonzero(~of_sensors.seen & is_large & (left > MOST)).tolist():
        is_misfit[joint] |= _slow(last, joint) > MOST
    is_misfit &= ~is_extrapolated(squares(last.fitted.residual), last.held_squares)
    # The rounding of a log, half a step at most, is no white noise but a function of its torque.
    is_misfit &= _rms(last) > last.prepared.torque_step / 2
    for push in last.hypothesis.accepted:
        # One that explains its own joint leaves much at others, where it acted otherwise than was fitted.
        if push.is_event and not is_misfit[push.family.joint]:
            is_misfit[list(push.member.rows)] = False
    for joint in np.flatnonzero(is_misfit).tolist():
        yield Unclaimed(joint, NOTHING, min(float(left[joint]), 1.0))


def _slow(stage: Stage, joint: int) -> float:
    """Share of a joint's squared residual in the frequencies of its motion: 0 for noise, 1 for no noise."""
    own = [run[:, joint] for run in stage.fitted.held_out]
    used = [run[:, joint] for run in stage.hypothesis.used]
    share, expected = slow_share(stage.prepared.runs, joint, own, used)
    return (share - expected) / (1 - expected)


def _rms(stage: Stage) -> Array:
    """RMS of each joint's held-out residual, (n,) N·m."""
    return np.sqrt(stage.held_squares / np.maximum(stage.counts, 1))


def _relative(stage: Stage) -> Array:
    """The same by the joint's RMS torque."""
    return _rms(stage) / stage.base.torque_rms
