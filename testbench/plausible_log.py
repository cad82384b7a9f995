"""A log against the model that it is read for: what no robot does, but a slip of units, wraps or columns."""

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d
from scipy.optimize import linear_sum_assignment

from identification.chain import Chain
from identification.errors import InputError
from identification.inverse_dynamics import inverse_dynamics
from identification.parameters import without_friction

from .log import Recording, check_joints
from .lost_samples import MOST_LOST
from .robot import Limits

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

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
# Hz, of the means that are compared with the model; fewer of them tell nothing.
MEANS_RATE, FEWEST_MEANS = 25.0, 50
# Torque is opposed to the model's where their sum is below this share of it, RMS.
OPPOSED = 0.5
# So it is where what goes with speed drives the joint instead: their correlation, that part's share of the
# torque, RMS, and of the variance without it that it leaves at most.
DRIVING, SHARE_OF_FRICTION, FRICTION_LEAVES = -0.7, 0.4, 0.35
# Share of the samples without the fastest.
USUAL_SPEED = 0.9
# Torque has lost its sign where it is never below zero, though the model's is on either side of it in this
# share of the samples in which the joint moves.
EITHER_SIDE = 0.1
# Torque is another joint's where its own motion leaves more than this share of its variance, and so many
# times what the other's leaves; of joints that move by so many rad/s (m/s), RMS.
OWN_LEAVES, TIMES_OTHERS, MOVING = 0.15, 5.0, 0.02


def check_motion(recording: Recording, chain: Chain, limits: Limits, source: object) -> None:
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


def check_torque(recording: Recording, chain: Chain, parameters: Array, source: object) -> None:
    """Raise InputError, naming ``source``, where torques have no sign or the wrong one, or are other joints'.

    All but certainly, by what a model has along the motion. parameters: (14 n,) standard ones of the model.
    """
    size = max(1, round(recording.sample_rate / MEANS_RATE))
    if len(recording.time) < FEWEST_MEANS * size:
        return
    time = _means(recording.time, size)
    q, torque = _means(recording.position, size), _means(recording.torque, size)
    dq = np.gradient(q, time, axis=0)
    ddq = np.gradient(dq, time, axis=0)
    model = inverse_dynamics(chain, parameters, q, dq, ddq)
    links = inverse_dynamics(chain, without_friction(parameters), q, dq, ddq)
    _check_signed(recording.torque, torque, model, dq, chain, source)
    _check_sign(torque, model, links, dq, ddq, chain, source)
    _check_order(torque, model, dq, ddq, chain, source)


def _check_signed(
    logged: Array, torque: Array, model: Array, dq: Array, chain: Chain, source: object
) -> None:
    """Raise InputError where torques are the model's but for a sign that none of them has.

    logged: (N, n). torque, model, dq: (M, n) means; of a joint at rest friction may have either sign.
    """
    moves = np.abs(dq) > MOVING
    below, above = (np.sum(moves & side, axis=0) for side in (model < 0, model > 0))
    fewest = EITHER_SIDE * np.maximum(np.sum(moves, axis=0), FEWEST_MEANS)
    never_below = (logged.min(axis=0) >= 0) & (np.minimum(below, above) > fewest)
    without, with_sign = (np.where(moves, torque - each, 0.0) for each in (np.abs(model), model))
    unsigned = never_below & (_rms(without) < OPPOSED * _rms(with_sign))
    if np.any(unsigned):
        names = ", ".join(chain.joint_names[joint] for joint in np.flatnonzero(unsigned))
        got = f"none below zero at {names}, where the model's are"
        raise InputError(source, "joint/torque", "torques with their sign", got)


def _check_sign(
    torque: Array, model: Array, links: Array, dq: Array, ddq: Array, chain: Chain, source: object
) -> None:
    """Raise InputError where torques are the model's but for their sign, or friction drives a joint.

    torque, model, links, dq, ddq: (M, n) means; links: of the model without friction.
    """
    backwards = np.flatnonzero(_is_cancelled(torque, model, dq) | _is_driven(torque, links, dq, ddq))
    if len(backwards):
        names = ", ".join(chain.joint_names[joint] for joint in backwards)
        expected = "the sign that turns a joint the way its position grows"
        raise InputError(source, "joint/torque", expected, f"the opposite at {names}")


def _is_cancelled(torque: Array, model: Array, dq: Array) -> Mask:
    """Where (n,) the torque nearly cancels the model's, in its mean and in its changes.

    And the drive takes work out of the joint on the whole. Arguments as of ``_check_sign``.
    """
    cancelled = _rms(torque + model) < OPPOSED * _rms(torque)
    changes = torque - torque.mean(axis=0)
    cancelled &= _rms(changes + model - model.mean(axis=0)) < OPPOSED * _rms(changes)
    return cancelled & (np.sum(torque * dq, axis=0) < 0)


def _is_driven(torque: Array, links: Array, dq: Array, ddq: Array) -> Mask:
    """Where (n,) much of the torque is friction with the wrong sign. Arguments as of ``_check_sign``.

    Without the fastest samples as well: what pushes a joint goes with its speed, but not most of the time.
    """
    driven = np.zeros(torque.shape[1], bool)
    for joint in np.flatnonzero(_rms(dq) > MOVING).tolist():
        speed, own = dq[:, joint], torque[:, joint]
        x = _regressor(links[:, joint], speed, ddq[:, joint])
        usual = np.abs(speed) <= np.quantile(np.abs(speed), USUAL_SPEED)
        driven[joint] = _rms(speed[usual]) > MOVING and all(
            _drives(x[part], speed[part], own[part]) for part in (slice(None), usual)
        )
    return driven


def _drives(x: Array, speed: Array, torque: Array) -> bool:
    """Whether much of a joint's torque (M,) is friction that goes with its speed. x: of ``_regressor``."""
    values, without = (np.linalg.lstsq(part, torque, rcond=None)[0] for part in (x, x[:, :-2]))
    friction = x[:, -2:] @ values[-2:]
    goes_with = friction @ speed < DRIVING * np.linalg.norm(friction) * np.linalg.norm(speed)
    is_much = np.std(friction) > SHARE_OF_FRICTION * np.std(torque)
    explains = np.var(torque - x @ values) < FRICTION_LEAVES * np.var(torque - x[:, :-2] @ without)
    return bool(goes_with and is_much and explains)


def _regressor(model: Array, speed: Array, acceleration: Array) -> Array:
    """What a joint's torque may be made of, (M, 5): the model's, rotor, offset and friction, the last two."""
    x = np.column_stack([model, acceleration, np.ones(len(model)), speed, np.sign(speed)])
    return np.asarray(x / np.maximum(_rms(x), np.finfo(float).tiny))


def _check_order(torque: Array, model: Array, dq: Array, ddq: Array, chain: Chain, source: object) -> None:
    """Raise InputError where torques stand in each other's columns. All but chain, source: (M, n) means.

    There each follows the model's torque, speed, friction and acceleration of the other joint, whatever the
    parameters, and hardly its own.
    """
    left, varied = np.ones((chain.joints, chain.joints)), np.var(torque, axis=0).clip(np.finfo(float).tiny)
    for joint in np.flatnonzero(_rms(dq) > MOVING).tolist():
        x = _regressor(model[:, joint], dq[:, joint], ddq[:, joint])
        unexplained = torque - x @ np.linalg.lstsq(x, torque, rcond=None)[0]
        left[:, joint] = np.var(unexplained, axis=0) / varied
    joints, follow = linear_sum_assignment(left)
    moved, others = joints[joints != follow], follow[joints != follow]
    own = left[moved, moved]
    if len(moved) and np.all(own > np.maximum(OWN_LEAVES, TIMES_OTHERS * left[moved, others])):
        names = chain.joint_names
        pairs = zip(moved.tolist(), others.tolist(), strict=True)
        got = ", ".join(f"{names[joint]}'s following the motion of {names[other]}" for joint, other in pairs)
        raise InputError(source, "joint/torque", "positions and torques in the order of joint_names", got)


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


def _means(values: Array, size: int) -> Array:
    """Means of so many samples in a row, (N // size, ...)."""
    count = len(values) // size
    return values[: count * size].reshape(count, size, *values.shape[1:]).mean(axis=1)


def _rms(values: Array) -> Array:
    return np.asarray(np.sqrt(np.mean(values**2, axis=0)))
