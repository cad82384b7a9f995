"""Vibration: what shakes a joint at one frequency, from outside, looks like a drive that is late there.

A controller answers a shaken joint with torque at that frequency, a quarter of a turn from what shakes it or
so, and so does a lag. But a lag is one at every frequency: split into that line and all else, its torque has
one coefficient.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.fft import rfft, rfftfreq

from testbench.effects.signature import Member

from ..data.run import Run
from ..fit.score import Gain, Stage
from ..model.candidate import Candidate
from ..plausibility.accepted import Accepted, without_one
from ..plausibility.materiality import SMALLEST_SHARE
from ..residual.localisation import share_left
from ..residual.shares import NOTHING, Unclaimed
from ..residual.spectrum import SMALLEST, kept_rate

Array = NDArray[np.float64]

VIBRATION = "vibration"
# Hz, of a line to either side of its middle.
HALF_LINE = 0.5
# Standard deviations, and share of the whole, by which parts of a lag may differ: a drive of two stages has
# not quite one law.
DEVIATIONS, LIKE_WHOLE = 2.5, 0.25
# A vibration is most of what is left, and its line holds less than half as much of the motion's torque.
MOST = 0.5
# Of a line's sines, singular values below this share of the largest are the same ones once more.
WORTH_A_WAVE = 1e-3


def vibrations(first: Stage, last: Stage, accepted: Sequence[Accepted]) -> tuple[Unclaimed, ...]:
    """Joints with a reported lag of the drive that is really a vibration at one frequency.

    first: re-identification, without effects. last: with all accepted effects.
    """
    left, found = share_left(first, last), []
    for place, item in enumerate(accepted):
        joint = item.candidate.family.joint
        if not item.named or not item.candidate.description.is_lag or joint is None:
            continue
        alone = Stage(*without_one(last.base, accepted, place))
        law = [run @ last.fitted.values[last.hypothesis.parts[place]] for run in item.candidate.filtered]
        (f, before), (_, after) = (_spectrum(*_left(stage, joint)) for stage in (alone, last))
        # Where it explains most, and where it has most torque to explain any with.
        lines = strongest_line(f, before - after), strongest_line(*_spectrum(law, last.prepared.runs))
        for line in lines:
            gain = alone.gain(_split(item.candidate, law, line, last.prepared.runs))
            if gain is not None and not is_one_law(gain):
                # Not what is explained there beside it.
                taken_off = share_left(first, alone)[joint] - left[joint]
                found.append(Unclaimed(joint, VIBRATION, float(np.clip(taken_off, 0.0, 1.0)), line))
                break
    return tuple(found)


def without_shaken(accepted: Sequence[Accepted], found: Sequence[Unclaimed]) -> list[Accepted]:
    """The accepted effects without lags that are vibrations, since no simulator reproduces those.

    found: of ``vibrations``, among others.
    """
    shaken = {each.joint for each in found if each.regime == VIBRATION}
    return [
        a for a in accepted if not a.candidate.description.is_lag or a.candidate.family.joint not in shaken
    ]


def worth_reporting(found: Sequence[Unclaimed]) -> list[Unclaimed]:
    """The unexplained residuals, without vibrations of a smaller share than an effect must explain."""
    return [each for each in found if each.regime != VIBRATION or each.share > SMALLEST_SHARE]


def with_its_line(last: Stage, item: Unclaimed) -> Unclaimed:
    """An unexplained residual with the frequency that dominates it, if that does not dominate the motion.

    last: with all accepted effects.
    """
    if item.regime != NOTHING:
        return item
    residual, runs = _left(last, item.joint)
    gaps = zip(last.prepared.runs, last.hypothesis.gap, strict=True)
    motion = [(run.torque - gap)[:, [item.joint]] for run, gap in gaps]
    left, moving = _spectrum(residual, runs), _spectrum(motion, last.prepared.runs)
    line = strongest_line(*left)
    shaken, moved = (
        float(power[_is_in(f, line)].sum() / max(power.sum(), SMALLEST)) for f, power in (left, moving)
    )
    is_line = shaken > MOST and moved < MOST * shaken
    return replace(item, frequency=line) if is_line else item


def _left(stage: Stage, joint: int) -> tuple[list[Array], list[Run]]:
    """A joint's residual, a run (M, 1), interpolated over samples not used; and the runs that have any."""
    found, shown = [], []
    for run, left in zip(stage.prepared.runs, stage.fitted.residual, strict=True):
        used, index = run.used[:, joint], np.arange(len(left))
        if used.any():
            found.append(np.interp(index, index[used], left[used, joint])[:, None])
            shown.append(run)
    return found, shown


def _split(lag: Candidate, law: Sequence[Array], line: float, runs: Sequence[Run]) -> Candidate:
    """A lag's torque as it was fitted, a run (M, r): in a line, beside it, and the line a quarter later."""
    columns = []
    for each, run in zip(law, runs, strict=True):
        # Sines that are fitted leave nothing of a line that does not close at the run's end.
        time = np.arange(len(each)) / kept_rate(run)
        lines = np.arange(line - HALF_LINE, line + HALF_LINE, 0.5 / max(time[-1], 1.0))
        angle = 2 * np.pi * np.outer(time, lines)
        waves, turned = (
            np.concatenate(both, axis=1)
            for both in ([np.cos(angle), np.sin(angle)], [np.sin(angle), -np.cos(angle)])
        )
        own = np.linalg.lstsq(waves, each, rcond=WORTH_A_WAVE)[0]
        columns.append(np.stack([waves @ own, each - waves @ own, turned @ own], axis=2))
    free = np.full(3, np.inf)
    return replace(lag, member=Member({}, lag.member.rows, (), -free, free), filtered=tuple(columns))


def _spectrum(torque: Sequence[Array], runs: Sequence[Run]) -> tuple[Array, Array]:
    """Frequencies, Hz, and power of a torque less its mean, a run (M, 1), one run after the other."""
    frequencies = [rfftfreq(len(each), 1 / kept_rate(run)) for each, run in zip(torque, runs, strict=True)]
    power = [np.abs(rfft(each[:, 0] - each.mean())) ** 2 for each in torque]
    return np.concatenate(frequencies), np.concatenate(power)


def strongest_line(frequencies: Array, power: Array) -> float:
    """The middle of what has most power within the width of a line, Hz."""
    middles = np.arange(HALF_LINE, max(frequencies.max(), 2 * HALF_LINE), HALF_LINE / 2).tolist()
    strongest = max(middles, key=lambda middle: float(power[_is_in(frequencies, middle)].sum()))
    inside = _is_in(frequencies, strongest)
    if not inside.any():
        # Runs of less than a second have none as narrow.
        return float(strongest)
    return float(np.average(frequencies[inside], weights=np.maximum(power[inside], SMALLEST)))


def _is_in(frequencies: Array, line: float) -> NDArray[np.bool_]:
    return np.abs(frequencies - line) < HALF_LINE


def is_one_law(gain: Gain) -> bool:
    """Whether a lag keeps its size on the line and off it, where it is significant, and its phase.

    gain: of the parts of ``_split``, in units of the whole as it was fitted.
    """
    deviations = DEVIATIONS * np.sqrt(np.diag(np.linalg.pinv(gain.information, hermitian=True)))
    # None of it is a quarter of a turn later.
    apart = np.abs(gain.coefficients - [1.0, 1.0, 0.0])
    is_seen_beside = gain.coefficients[1] > deviations[1]
    return bool(is_seen_beside and np.all(apart < np.maximum(deviations, LIKE_WHOLE)))
