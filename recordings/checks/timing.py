"""How a log was sampled: jitter, lost samples, values of a slower bus, rests at its ends."""

import numpy as np
from numpy.typing import NDArray

from testbench.log import REQUIRED, Recording
from testbench.lost_samples import held_by_a_bus, lost_samples

from .finding import Finding, Severity
from .subject import Subject

Array = NDArray[np.float64]

STAGE = 0

# Of a step: stamps that stray more, at the worst hundredth of them, are worth a word.
JITTER = 0.1
# Steps so many times the usual one are gaps.
GAP = 1.8
# Of a run: rest at its ends that is longer is worth a word.
REST = 0.1
# rad/s (m/s), over a tenth of a second: slower is rest.
AT_REST = 0.002


def check(subject: Subject) -> list[Finding]:
    """Of every run how its samples stray from an even grid, and what was no measurement."""
    found = []
    for name, recording in subject.recordings.items():
        found += _stamps(name, recording)
        found += _bus(name, recording)
        lost = int(np.count_nonzero(lost_samples(recording)))
        if lost:
            share = lost / len(recording.time)
            sentence = f"{lost} samples ({share:.2%}) were held or spoiled on the way, and are interpolated"
            found.append(Finding(Severity.NOTE, "lost_samples", sentence, run=name))
        found += _rests(name, recording)
        said = recording.provenance.get("understood", [])
        found += [Finding(Severity.NOTE, "understood", str(each), run=name) for each in said]
    return found


def _stamps(name: str, recording: Recording) -> list[Finding]:
    steps = np.diff(recording.time)
    usual = float(np.median(steps))
    off = float(np.quantile(np.abs(steps - usual), 0.99)) / usual
    gaps = int(np.count_nonzero(steps > GAP * usual))
    found = []
    if gaps:
        longest = float(steps.max())
        sentence = f"{gaps} gaps in the time stamps, the longest of {longest:.3g} s; nothing is fitted there"
        found.append(Finding(Severity.NOTE, "gaps", sentence, run=name, field="time"))
    if off > JITTER:
        sentence = f"time stamps jitter by {off:.0%} of a step ({1e3 * off * usual:.2g} ms)"
        found.append(Finding(Severity.NOTE, "jitter", sentence, run=name, field="time"))
    return found


def _bus(name: str, recording: Recording) -> list[Finding]:
    found = []
    for channel in REQUIRED:
        repeated = float(np.mean(held_by_a_bus(getattr(recording, channel))))
        if repeated:
            rate = recording.sample_rate * (1 - repeated)
            sentence = (
                f"{channel} comes at {rate:.3g} Hz and is held at {recording.sample_rate:.3g} Hz: what is "
                "held is interpolated, and counts as no measurement"
            )
            found.append(Finding(Severity.NOTE, "slower_bus", sentence, run=name, field=f"joint/{channel}"))
    return found


def _rests(name: str, recording: Recording) -> list[Finding]:
    """Rest before and after a run."""
    reach = max(1, round(0.05 * recording.sample_rate))
    position = recording.position
    if len(position) <= 4 * reach:
        return []
    speed = np.abs(position[2 * reach :] - position[: -2 * reach]).max(axis=1) / (
        recording.time[2 * reach :] - recording.time[: -2 * reach]
    )
    moving = np.flatnonzero(speed > AT_REST)
    if not len(moving):
        return []
    # The window of the last speed at rest ends where the motion begins.
    before, after = (
        int(still) + 2 * reach if still else 0 for still in (moving[0], len(speed) - 1 - moving[-1])
    )
    if (before + after) / len(position) < REST:
        return []
    rests = [
        f"{samples / recording.sample_rate:.2g} s {when}"
        for samples, when in ((before, "before"), (after, "after"))
        if samples
    ]
    sentence = f"at rest for {' and '.join(rests)} the motion: not counted"
    return [Finding(Severity.NOTE, "rest", sentence, run=name, field="time")]
