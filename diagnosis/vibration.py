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

from .accepted import Accepted
from .candidates import Candidate
from .healthy import LAG
from .naming import without_one
from .preparation import Run
from .spectrum import kept_rate
from .unclaimed import Unclaimed, share_left
from .weighing import Gain, Stage

Array = NDArray[np.float64]

VIBRATION = "vibration at one frequency"
# Hz: the line to either side of its middle, and how far apart the middles are.
HALF_LINE, APART = 0.5, 0.25
# Standard deviations that what lies beside the line must be from none, and may be from what lies in it; and
# the share of it by which laws of all kinds may differ.
FROM_NONE, FROM_LINE, LIKE_LINE = 2.0, 4.0, 0.2
# Standard deviations and the share of the line by which it is another's, a quarter of a turn from a lag's: of
# two stages a little is, too.
LATER, LATER_SHARE = 6.0, 0.3
# Of a line's sines, singular values below this share of the largest are the same ones once more.
WORTH_A_WAVE = 1e-3


def vibrations(first: Stage, last: Stage, accepted: Sequence[Accepted]) -> tuple[Unclaimed, ...]:
    """Joints whose drive is named late, but not beside one line of frequency.

    first: re-identification alone. last: with all effects taken in.
    """
    left, found = share_left(first, last), []
    for place, item in enumerate(accepted):
        joint = item.candidate.family.joint
        if not item.named or item.candidate.family.effect != LAG or joint is None:
            continue
        alone = Stage(last.ground, *without_one(last.ground, accepted, place))
        law = last.hypothesis.parts[place]
        gain = alone.gain(_split(item.candidate, last.fitted.values[law], alone.prepared.runs))
        if gain is not None and not _is_one_law(gain):
            found.append(Unclaimed(joint, VIBRATION, 1 - float(left[joint])))
    return tuple(found)


def _split(lag: Candidate, values: Array, runs: Sequence[Run]) -> Candidate:
    """A lag's torque as it was fitted, by coefficients (k,), as three columns.

    They are its strongest line, what is beside that, and the line a quarter of a turn later.
    """
    law = [run @ values for run in lag.filtered]
    strongest = _strongest_line(law, runs)
    columns = []
    for each, run in zip(law, runs, strict=True):
        # Sines that are fitted leave nothing of a line that does not close at the run's end.
        time = np.arange(len(each)) / kept_rate(run)
        lines = np.arange(strongest - HALF_LINE, strongest + HALF_LINE, 0.5 / max(time[-1], 1.0))
        angle = 2 * np.pi * np.outer(time, lines)
        waves, turned = (
            np.concatenate(both, axis=1)
            for both in ([np.cos(angle), np.sin(angle)], [np.sin(angle), -np.cos(angle)])
        )
        own = np.linalg.lstsq(waves, each, rcond=WORTH_A_WAVE)[0]
        columns.append(np.stack([waves @ own, each - waves @ own, turned @ own], axis=2))
    free = np.full(3, np.inf)
    return replace(lag, member=Member({}, lag.member.rows, (), -free, free), filtered=tuple(columns))


def _strongest_line(law: Sequence[Array], runs: Sequence[Run]) -> float:
    """Where a torque, a run (M, r), has most power within the width of a line, Hz."""
    spectra = [np.sum(np.abs(rfft(run, axis=0)) ** 2, axis=1) for run in law]
    frequencies = [rfftfreq(len(each), 1 / kept_rate(run)) for each, run in zip(law, runs, strict=True)]
    middles = np.arange(HALF_LINE, min(f[-1] for f in frequencies), APART)
    power = [
        sum(
            float(np.sum(s[np.abs(f - middle) < HALF_LINE]))
            for s, f in zip(spectra, frequencies, strict=True)
        )
        for middle in middles
    ]
    return float(middles[np.argmax(power)])


def _is_one_law(gain: Gain) -> bool:
    """Whether what is beside the line is there for certain, is what is in it, and is in phase with it."""
    line, beside, later = gain.coefficients.tolist()
    covariance = np.linalg.pinv(gain.information, hermitian=True)
    is_there = beside > FROM_NONE * float(np.sqrt(covariance[1, 1]))
    differs = float(np.sqrt(covariance[0, 0] - 2 * covariance[0, 1] + covariance[1, 1]))
    is_alike = abs(line - beside) < max(FROM_LINE * differs, LIKE_LINE * max(line, beside))
    is_later = abs(later) > max(LATER * float(np.sqrt(covariance[2, 2])), LATER_SHARE * line)
    return is_there and is_alike and not is_later
