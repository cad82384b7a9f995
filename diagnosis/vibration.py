"""Vibration: what shakes a joint at one frequency, from outside, looks like a drive that is late there.

A controller answers a shaken joint with torque at that frequency, a quarter of a turn from what shakes it or
so, and so does a lag. But a lag is one at every frequency: split into that line and all else, its torque has
one coefficient.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft, rfft, rfftfreq

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
    """A lag's torque, fitted by coefficients (k,), as two columns: in its strongest line, and beside it."""
    law = [run @ values for run in lag.filtered]
    spectra = [rfft(run, axis=0) for run in law]
    frequencies = [rfftfreq(len(each), 1 / kept_rate(run)) for each, run in zip(law, runs, strict=True)]
    middles = np.arange(APART, min(f[-1] for f in frequencies), APART)
    power = np.zeros(len(middles))
    for spectrum, f in zip(spectra, frequencies, strict=True):
        for place, middle in enumerate(middles):
            power[place] += np.sum(np.abs(spectrum[_is_in_line(f, middle)]) ** 2)
    strongest = float(middles[np.argmax(power)])
    columns = []
    for each, spectrum, f in zip(law, spectra, frequencies, strict=True):
        in_line = irfft(spectrum * _is_in_line(f, strongest)[:, None], len(each), axis=0)
        columns.append(np.stack([in_line, each - in_line], axis=2))
    free = np.full(2, np.inf)
    return replace(lag, member=Member({}, lag.member.rows, (), -free, free), filtered=tuple(columns))


def _is_in_line(frequencies: Array, middle: float) -> NDArray[np.bool_]:
    return np.abs(frequencies - middle) < HALF_LINE


def _is_one_law(gain: Gain) -> bool:
    """Whether what is beside the line is there for certain, and is what is in it."""
    line, beside = gain.coefficients.tolist()
    covariance = np.linalg.pinv(gain.information, hermitian=True)
    differs = float(np.sqrt(np.array([1, -1]) @ covariance @ np.array([1, -1])))
    is_there = beside > FROM_NONE * float(np.sqrt(covariance[1, 1]))
    return is_there and abs(line - beside) < max(FROM_LINE * differs, LIKE_LINE * max(line, beside))
