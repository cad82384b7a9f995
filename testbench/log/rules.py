"""The rules of the robot-log format that a recording obeys: shapes, times and values."""

import numpy as np
from numpy.typing import NDArray

from identification.errors import InputError

from ..drive import check_drive
from .recording import CHANNELS, POSITION_SERVO, Recording

Array = NDArray[np.float64]

FORMAT, VERSION, VERSION_OF_DRIVES = "robot-log", 1, 1.1
CONTROLLER_KINDS = ("pd", "pd_with_model_feedforward", POSITION_SERVO, "unknown")
# Median sample interval against sample_rate: clocks of real robots jitter, but not on the whole.
RATE_TOLERANCE = 0.01
# Nothing is measured as more, in any unit; squares of it are no number.
LARGEST = 1e100
# A log is put on a grid, gaps and all, which may be so many times as long as its samples.
MOST_GAPS = 100


def check_recording(recording: Recording, source: object) -> None:
    """Raise InputError, naming ``source``, unless shapes, times and values obey the format."""
    names = recording.joint_names
    if not names or len(set(names)) != len(names) or not all(names):
        raise InputError(source, "joint_names", "distinct names, one a joint", list(names))
    _check_time(recording, source)
    shape = (len(recording.time), len(names))
    for name, channel, _, _ in CHANNELS:
        values = getattr(recording, channel)
        is_replaced = channel == "torque" and recording.has_drive and not recording.has_torque
        if values is not None and not is_replaced:
            _check_values(values, shape, f"{shape}, samples of time by joint_names", name, recording, source)
    if recording.is_slide and len(recording.is_slide) != len(names):
        raise InputError(source, "is_slide", f"{len(names)} flags or none", len(recording.is_slide))
    if recording.drive is not None:
        check_drive(recording.drive, names, source)
    controller = recording.controller
    if controller is None:
        return
    if controller.kind not in CONTROLLER_KINDS:
        raise InputError(source, "controller kind", "a controller", repr(controller.kind), CONTROLLER_KINDS)
    for name, value in (("rate", controller.rate), ("coulomb_smoothing", controller.coulomb_smoothing)):
        if value is not None and not (np.isfinite(value) and value > 0):
            raise InputError(source, f"controller {name}", "a positive number", value)
    if controller.delay is not None and not 0 <= controller.delay < np.inf:
        raise InputError(source, "controller delay", "a number of seconds from 0 on", controller.delay)
    for name, gains in (("kp", controller.kp), ("kd", controller.kd)):
        if gains is not None:
            _check_values(
                gains, shape[1:], f"{shape[1:]}, one a joint", f"controller/{name}", recording, source
            )


def _check_time(recording: Recording, source: object) -> None:
    """Time: (N,) with N >= 2, finite, strictly increasing, and at sample_rate."""
    time, rate = np.asarray(recording.time), recording.sample_rate
    if time.ndim != 1 or len(time) < 2:
        raise InputError(source, "time", "shape (N,) with N >= 2", time.shape)
    if not np.isfinite(time).all():
        sample = int(np.argmin(np.isfinite(time)))
        raise InputError(source, "time", "finite values", f"{time[sample]} at sample {sample}")
    steps = np.diff(time)
    if (steps <= 0).any():
        sample = int(np.argmax(steps <= 0)) + 1
        got = f"{time[sample]:.9g} s after {time[sample - 1]:.9g} s at sample {sample}"
        raise InputError(source, "time", "strictly increasing values", got)
    if not (np.isfinite(rate) and rate > 0):
        raise InputError(source, "sample_rate", "a positive number of Hz", rate)
    longest = MOST_GAPS * len(time) / rate
    if not time[-1] - time[0] <= longest:
        expected = f"{len(time)} samples within {longest:.4g} s, {MOST_GAPS} times as long as they take"
        raise InputError(source, "time", expected, f"{time[-1] - time[0]:.4g} s from first to last")
    measured = 1 / float(np.median(steps))
    if abs(measured / rate - 1) > RATE_TOLERANCE:
        expected = f"{measured:.6g} Hz, one over the median step of time, within {RATE_TOLERANCE:.0%}"
        raise InputError(source, "sample_rate", expected, rate)


def _check_values(
    values: Array, shape: tuple[int, ...], expected: str, name: str, recording: Recording, source: object
) -> None:
    """Shape and finite values; the joint and sample of the first value that is not finite is named."""
    values = np.asarray(values)
    if values.shape != shape:
        raise InputError(source, name, f"shape {expected}", values.shape)
    finite = is_measurable(values)
    if not finite.all():
        first = np.argwhere(~finite)[0]
        at = f" at sample {first[0]}" if values.ndim == 2 else ""
        got = f"{values[tuple(first)]}{at}, joint {recording.joint_names[first[-1]]}"
        raise InputError(source, name, f"finite values up to {LARGEST:g}", got)


def is_measurable(values: Array) -> NDArray[np.bool_]:
    """Which values are finite, and no larger than anything is measured as."""
    # Of NaN neither is so.
    return np.asarray(np.abs(values) <= LARGEST)
