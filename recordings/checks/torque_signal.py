"""Torques that are none: absent, unsigned, clipped, in coarse steps, zero at rest, or velocities."""

import numpy as np
from numpy.typing import NDArray

from identification.inverse_dynamics import inverse_dynamics
from testbench.log import Recording

from .finding import Finding, Severity
from .samples import MOVING, Samples
from .subject import Subject

Array = NDArray[np.float64]

STAGE = 1

# Torque has lost its sign where it is never below zero, though a joint turns both ways in this share of its
# samples at least, and the model's size leaves less of it, squared, than this share of what the model leaves.
EITHER_WAY, UNSIGNED = 0.1, 0.25
# Torque is speed where nothing but this share of its variance is left of it, and their factor is so nearly
# one.
SPEED_LEAVES, SPEED_FACTOR = 0.02, 1.25
# By the model a joint is little but damped where speed leaves less of its torque's variance.
DAMPED = 0.2
# A torque that is clipped is at its largest in this share of the samples, in so many of them in a row.
CLIPPED, IN_A_ROW = 0.005, 5
# One that is there in more of them never changes.
MOST = 0.9
# Steps that are coarser than this share of a torque, RMS, are worth a word.
COARSE = 0.05
# Of a range: what is less is no step. Of a step: levels are whole steps to this.
ROUNDING, EVEN = 1e-9, 0.05
# Share of samples that are exactly zero while others are not.
ZEROED = 0.02


def check(subject: Subject) -> list[Finding]:
    """Of all runs together: what the torque cannot be, and where it is no measurement."""
    torque = np.concatenate([each.torque for each in subject.recordings.values()])
    found = [_none(subject, name) for name, each in subject.recordings.items() if not each.torque.any()]
    if found:
        return found
    samples = subject.samples
    if samples is not None:
        chain, parameters = subject.robot.chain, subject.robot.parameters
        model = inverse_dynamics(chain, parameters, samples.q, samples.dq, samples.ddq, threads=1)
        found += _velocity(subject, samples, model)
        if not found:
            found += _unsigned(subject, samples, torque, model)
    moves = np.concatenate([_speeds(each) > MOVING for each in subject.recordings.values()])
    found += _silent(subject, torque)
    # Of runs that count in different steps the finest.
    step = np.min(
        [[_step(column) for column in each.torque.T] for each in subject.recordings.values()], axis=0
    )
    share = step / np.maximum(np.sqrt(np.mean(torque**2, axis=0)), np.finfo(float).tiny)
    found += _clipped(subject, share > COARSE)
    found += _coarse(subject, step, share)
    found += _zeroed(subject, torque, moves, share > COARSE)
    return found


def _none(subject: Subject, run: str) -> Finding:
    sentence = f"0 at every sample of {', '.join(subject.robot.joint_names)}"
    expected = "joint torques that are not all zero"
    return Finding(
        Severity.STOP, "no_torque", sentence, subject.robot.joint_names, run, "joint/torque", expected
    )


def _velocity(subject: Subject, samples: Samples, model: Array) -> list[Finding]:
    """Joints whose torque is their own speed, though they are not little but damped by the model (M, n)."""
    joints = []
    for joint in range(subject.robot.joints):
        moves = samples.moves[:, joint]
        speed, torques = (
            samples.dq[moves, joint],
            np.stack([each[moves, joint] for each in (samples.torque, model)]),
        )
        if len(speed) < 10 or np.std(torques[0]) == 0:
            continue
        x = np.column_stack([speed, np.ones(len(speed))])
        values = np.linalg.lstsq(x, torques.T, rcond=None)[0]
        left = np.var(torques - (x @ values).T, axis=1) / np.maximum(
            np.var(torques, axis=1), np.finfo(float).tiny
        )
        is_damped = left[1] < DAMPED
        if left[0] < SPEED_LEAVES and 1 / SPEED_FACTOR < values[0, 0] < SPEED_FACTOR and not is_damped:
            joints.append(joint)
    if not joints:
        return []
    names = subject.names(joints)
    sentence = f"the velocity, to {SPEED_LEAVES:.0%} of its variance, at {', '.join(names)}"
    return [
        Finding(Severity.STOP, "velocity_as_torque", sentence, names, "", "joint/torque", "joint torques")
    ]


def _unsigned(subject: Subject, samples: Samples, torque: Array, model: Array) -> list[Finding]:
    """Joints whose torques have no sign. model: the model's (M, n), along the samples."""
    robot = subject.robot
    joints = []
    for joint in range(robot.joints):
        moves = samples.moves[:, joint]
        own, modelled = samples.torque[moves, joint], model[moves, joint]
        positive = samples.dq[moves, joint] > 0
        if len(own) < 10 or torque[:, joint].min() < 0 or not torque[:, joint].any():
            continue
        both_ways = min(np.mean(positive), np.mean(~positive)) > EITHER_WAY
        either_side = min(np.mean(modelled > 0), np.mean(modelled < 0)) > EITHER_WAY
        if both_ways and either_side and _left(own, np.abs(modelled)) < UNSIGNED * _left(own, modelled):
            joints.append(joint)
    if not joints:
        return []
    names = subject.names(joints)
    sentence = f"none below zero at {', '.join(names)}, where the model's are"
    return [
        Finding(Severity.STOP, "unsigned", sentence, names, "", "joint/torque", "torques with their sign")
    ]


def _left(torque: Array, model: Array) -> float:
    """The square that the model leaves of a torque (m,), at its likeliest scale."""
    scale = float(torque @ model) / max(float(model @ model), 1e-300)
    return float(np.sum((torque - scale * model) ** 2))


def _silent(subject: Subject, torque: Array) -> list[Finding]:
    joints = np.flatnonzero(np.ptp(torque, axis=0) == 0).tolist()
    if not joints:
        return []
    names = subject.names(joints)
    sentence = f"The logged torque of {', '.join(names)} never changes: nothing can be said of it"
    return [Finding(Severity.WARN, "silent", sentence, names, "", "joint/torque")]


def _clipped(subject: Subject, coarse: NDArray[np.bool_]) -> list[Finding]:
    """Joints whose torque stays at its largest, again and again."""
    joints, levels = [], []
    for joint in range(subject.robot.joints):
        columns = [each.torque[:, joint] for each in subject.recordings.values()]
        largest = max(float(np.abs(column).max()) for column in columns)
        at = [np.abs(column) >= largest * (1 - 1e-9) for column in columns]
        share = float(np.mean(np.concatenate(at)))
        # In coarse steps many a torque is the largest.
        if not coarse[joint] and CLIPPED < share < MOST and max(_longest(each) for each in at) >= IN_A_ROW:
            joints.append(joint)
            levels.append(
                f"{subject.robot.joint_names[joint]} at {largest:.3g} in {share:.1%} of the samples"
            )
    if not joints:
        return []
    sentence = f"The torque is clipped: {', '.join(levels)}; it is not known there"
    return [Finding(Severity.WARN, "saturated", sentence, subject.names(joints), "", "joint/torque")]


def _longest(flags: NDArray[np.bool_]) -> int:
    """The most flags in a row."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], flags.astype(int), [0]])))
    return int(np.max(edges[1::2] - edges[::2], initial=0))


def _coarse(subject: Subject, step: Array, share: Array) -> list[Finding]:
    """Joints whose torque comes in steps (n,) that are a large share (n,) of it, RMS."""
    joints = np.flatnonzero(share > COARSE).tolist()
    steps = [f"{subject.robot.joint_names[j]} {step[j]:.3g} ({share[j]:.0%} of its RMS)" for j in joints]
    if not joints:
        return []
    sentence = f"The torque counts in steps: {', '.join(steps)}; smaller effects do not show"
    return [Finding(Severity.NOTE, "quantised", sentence, subject.names(joints), "", "joint/torque")]


def _step(torque: Array) -> float:
    """The even step that a torque (N,) counts in; 0 where it counts in none."""
    levels = np.unique(torque)
    gaps = np.diff(levels)
    gaps = gaps[gaps > ROUNDING * np.ptp(torque)]
    if len(gaps) < 2:
        return 0.0
    step = float(gaps.min())
    return step if np.all(np.abs(levels / step - np.round(levels / step)) < EVEN) else 0.0


def _zeroed(
    subject: Subject, torque: Array, moves: NDArray[np.bool_], coarse: NDArray[np.bool_]
) -> list[Finding]:
    """Joints whose torque is exactly zero at rest, and nowhere else."""
    zero = (torque == 0) & ~moves
    # In coarse steps zero is a torque like others.
    share = np.where(coarse, 0.0, np.mean(zero, axis=0))
    elsewhere = np.mean((torque == 0) & moves, axis=0)
    joints = np.flatnonzero((share > ZEROED) & (elsewhere < share / 10) & torque.any(axis=0)).tolist()
    if not joints:
        return []
    names = subject.names(joints)
    largest = max(float(share[joint]) for joint in joints)
    sentence = (
        f"The torque of {', '.join(names)} is exactly 0 at rest (up to {largest:.0%} of the samples): no "
        "measurement there, and no noise is estimated from it"
    )
    return [Finding(Severity.WARN, "zero_at_rest", sentence, names, "", "joint/torque")]


def _speeds(recording: Recording) -> Array:
    """Absolute speeds (N, n), over a tenth of a second."""
    reach = max(1, round(0.05 * recording.sample_rate))
    count = len(recording.time)
    before, after = np.maximum(np.arange(count) - reach, 0), np.minimum(np.arange(count) + reach, count - 1)
    steps = (recording.time[after] - recording.time[before])[:, None]
    return np.asarray(np.abs(recording.position[after] - recording.position[before]) / steps)
