"""Positions that no robot has: wrapped, broken, far out of range, or the command's own."""

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d

from identification.chain import Chain
from identification.errors import InputError
from testbench.log import Recording, check_joints
from testbench.lost_samples import MOST_LOST
from testbench.robot import Limits

from .finding import Finding, Severity
from .subject import Subject

Array = NDArray[np.float64]

STAGE = 0

TURN = 2 * np.pi
# A wrap is a step so near to a turn, rad, and so many times faster than the joint is anywhere else.
NEAR_A_TURN, FASTER = 0.5, 3.0
# A step is so many times faster than the joint is in so many samples to either side, and stays: no arm does.
# And faster, likewise, than it is at this share of all samples: at rest any count stands out.
BREAK, AROUND, NEARLY_ALL = 10.0, 20, 0.999
# And more than so many times the smallest step of its encoder.
COUNTS = 8.0
# Share of samples that may lie anywhere: spoiled ones are mended later.
SPOILED = 0.01


def check(subject: Subject) -> list[Finding]:
    """Positions that a joint cannot have, the first of each run."""
    found = []
    for name, recording in subject.recordings.items():
        try:
            require_plausible_motion(recording, subject.robot.chain, subject.robot.limits, name)
        except InputError as error:
            found.append(
                Finding(
                    Severity.STOP,
                    "position",
                    str(error.got),
                    run=name,
                    field=error.field,
                    expected=error.expected,
                )
            )
    return found


def require_plausible_motion(recording: Recording, chain: Chain, limits: Limits, source: object) -> None:
    """Raise InputError, naming ``source``, unless the joints are the model's and the positions can be theirs.

    They cannot where a position jumps between two samples, a hinge's by a turn or any by what its speed does
    not explain, or strays from the model's range by more than the range is wide; nor are they measured where
    they are the reference's at every sample.
    """
    check_joints(recording, chain.joint_names, source)
    followed = recording.reference_position
    if followed is not None and np.array_equal(recording.position, followed):
        expected = "measured positions"
        raise InputError(source, "joint/position", expected, "those of reference/position at every sample")
    for joint, name in enumerate(chain.joint_names):
        position, is_slide = recording.position[:, joint], chain.is_slide[joint]
        wrapped = None if is_slide else _wrap(recording.time, position)
        if wrapped is not None:
            step = position[wrapped] - position[wrapped - 1]
            got = f"a step of {step:.3g} rad {_when(recording, wrapped)} at {name} (unwrap it)"
            raise InputError(source, "joint/position", "continuous positions", got)
        broken = _break(recording.time, position)
        if broken is not None:
            unit = "m" if is_slide else "rad"
            step = f"a step of {position[broken] - position[broken - 1]:.3g} {unit}"
            asks = "are samples missing, are these two runs, or does its encoder lose counts?"
            got = f"{step} {_when(recording, broken)} at {name} ({asks})"
            raise InputError(source, "joint/position", "continuous positions", got)
        lower, upper = limits.lower[joint], limits.upper[joint]
        beyond = np.maximum(lower - position, position - upper)
        sample = int(np.argsort(beyond)[int((1 - SPOILED) * len(beyond))])
        if np.isfinite(upper - lower) and beyond[sample] > upper - lower:
            unit, slip = ("m", "millimetres") if is_slide else ("rad", "degrees")
            expected = f"positions of {name} about the model's range of {lower:.4g} to {upper:.4g} {unit}"
            got = f"{position[sample]:.4g} {unit} {_when(recording, sample)} (are these {slip}?)"
            raise InputError(source, "joint/position", expected, got)


def _wrap(time: Array, position: Array) -> int | None:
    """The first sample whose step from the one before is a turn that the joint's speed does not explain."""
    steps = np.abs(np.diff(position))
    turns = np.abs(steps - TURN) < NEAR_A_TURN
    speed = steps / np.diff(time)
    turns &= speed > FASTER * np.max(speed, where=~turns, initial=0.0)
    for sample in (np.flatnonzero(turns) + 1).tolist():
        # What is back at once was spoiled on the way, and is mended later.
        before = position[max(0, sample - 2 * MOST_LOST) : sample]
        after = position[sample : sample + 2 * MOST_LOST]
        if abs(np.median(after) - np.median(before)) > TURN / 2:
            return sample
    return None


def _break(time: Array, position: Array) -> int | None:
    """The first sample whose step from the one before is far faster than all around it, and is not undone."""
    moved = np.abs(np.diff(position))
    speed = moved / np.diff(time)
    counts = COUNTS * float(np.min(moved, where=moved > 0, initial=np.inf))
    if len(speed) <= 2 * AROUND:
        return None
    around = maximum_filter1d(speed, 2 * AROUND + 1)
    # Only what is fastest of its own neighbourhood can stand out of it; at an end an arm may still settle.
    inside = np.arange(AROUND, len(speed) - AROUND)
    fast = FASTER * float(np.quantile(speed, NEARLY_ALL))
    fastest = (speed == around) & (speed > fast) & (moved > counts)
    for step in inside[fastest[inside]].tolist():
        others = np.delete(speed[step - AROUND : step + AROUND + 1], AROUND)
        before, after = position[step + 1 - AROUND : step + 1], position[step + 1 : step + 1 + AROUND]
        stays = abs(np.median(after) - np.median(before)) > moved[step] / 2
        if speed[step] > BREAK * others.max() and stays:
            return step + 1
    return None


def _when(recording: Recording, sample: int) -> str:
    return f"at {recording.time[sample] - recording.time[0]:.4g} s"
