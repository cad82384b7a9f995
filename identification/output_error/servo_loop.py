"""Position servos simulated on a logged command, many candidates and windows as one batch.

Each step is the midpoint rule with the servo and viscous friction implicit (servo_step.py), as long as a
sample of the drive at most.
"""

import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..chain import Chain
from ..kinematics import copy_rows, kernel
from ..motion_equations import SCRATCH, mass_and_bias
from ..parameters import PER_JOINT
from .drive_law import drive_torque, friction_level
from .plant import COMMAND_STEP, DELAY, ENCODER_AFTER, GAP, INVERSE_RATE, SAG
from .servo_step import plain_step, step_with_play

Array = NDArray[np.float64]

# s, longest step.
STEP = 2.5e-3
# rad/s: what runs away faster is no robot any more.
RUNAWAY = 1e4
# Share of the torque that the deepest sag leaves.
LEAST_STRENGTH = 0.1
# What a trace has of each joint in each step: where it begins, the speed at its end, and what acts in it.
TRACED = ("position", "velocity", "acceleration", "new", "mean", "level", "share", "load", "damping")
AT, SPEED, BEFORE, NEW, MEAN, LEVEL, SHARE, LOAD, DAMPED = range(len(TRACED))


@dataclass(frozen=True)
class Window:
    """A stretch of a run that is simulated from a state of its own. n joints.

    command: (N, n) rad, of the whole run. kp, kd: (n,) N·m/rad and N·m·s/rad as that run states them.
    start, stop: the window's samples. position, velocity: (n,) at ``start``.
    """

    command: Array
    kp: Array
    kd: Array
    start: int
    stop: int
    position: Array
    velocity: Array


@dataclass(frozen=True)
class Simulated:
    """Position, velocity and drive torque at a window's samples, (M, n) each."""

    position: Array
    velocity: Array
    torque: Array


def simulate(
    chain: Chain,
    tables: Array,
    windows: Sequence[Window],
    rate: float,
    threads: int | None = None,
    step: float = STEP,
) -> list[list[Simulated]]:
    """Every window for each candidate, [candidate][window].

    tables: (C, n, WIDTH). rate: Hz, of the command. Where a candidate runs away, or has no positive mass
    matrix, the rest of its window is NaN. The result does not depend on the number of threads.
    """
    substeps = substeps_of(rate, step)
    held = {id(window.command): _summed(window.command, rate) for window in windows}
    untraced = np.empty((0, chain.joints, len(TRACED) + chain.joints))
    out = [
        [Simulated(*np.full((3, w.stop - w.start, chain.joints), np.nan)) for w in windows] for _ in tables
    ]

    def one(index: tuple[int, int]) -> None:
        candidate, window = index
        w, into = windows[window], out[candidate][window]
        _simulate(
            *chain.arrays, np.ascontiguousarray(tables[candidate]), w.command, held[id(w.command)],
            w.kp, w.kd, w.start, rate, substeps, w.position, w.velocity,
            into.position, into.velocity, into.torque, untraced,
        )  # fmt: skip

    work = [(candidate, window) for candidate in range(len(tables)) for window in range(len(windows))]
    workers = min(threads or os.cpu_count() or 1, len(work))
    if workers <= 1:
        for index in work:
            one(index)
    else:
        with ThreadPoolExecutor(workers) as pool:
            list(pool.map(one, work))
    return out


def traced(chain: Chain, table: Array, window: Window, rate: float) -> tuple[Simulated, Array]:
    """A window simulated with a table (n, WIDTH) that has no play, and its trace (steps, n, TRACED and n).

    After the figures of TRACED follows the row of the matrix that the step solves, M + h/2 D.
    """
    samples, n, substeps = window.stop - window.start, chain.joints, substeps_of(rate, STEP)
    out = Simulated(*np.full((3, samples, n), np.nan))
    trace = np.full(((samples - 1) * substeps, n, len(TRACED) + n), np.nan)
    _simulate(
        *chain.arrays, np.ascontiguousarray(table), window.command, _summed(window.command, rate),
        window.kp, window.kd, window.start, rate, substeps, window.position, window.velocity,
        out.position, out.velocity, out.torque, trace,
    )  # fmt: skip
    return out, trace


def substeps_of(rate: float, step: float) -> int:
    """Steps of the simulation in a sample of a drive at a rate, Hz; step: s, the longest."""
    return max(1, int(np.ceil(1 / (rate * step) - 1e-9)))


def _summed(command: Array, rate: float) -> Array:
    """Integral of the held command from the first sample to each, (N, n) rad·s."""
    total = np.zeros_like(command)
    np.cumsum(command[:-1] / rate, axis=0, out=total[1:])
    return total


@kernel
def _held(command: Array, total: Array, joint: int, time: float, rate: float) -> float:
    """Integral of the held command up to a time since its first sample; before it, and after its last, it
    stays as it is there."""
    at = time * rate
    last = command.shape[0] - 1
    index = int(np.floor(at + 1e-9))
    index = 0 if index < 0 else (last if index > last else index)
    return total[index, joint] + command[index, joint] * (at - index) / rate


@kernel
def _note(
    row: Array,
    q: Array,
    v: Array,
    a: Array,
    new: Array,
    mean: Array,
    level: Array,
    share: Array,
    load: Array,
    damping: Array,
    mass: Array,
) -> None:
    """A step's figures into its row (n, TRACED and n) of the trace."""
    for j in range(row.shape[0]):
        row[j, AT], row[j, SPEED], row[j, BEFORE], row[j, NEW] = q[j], v[j], a[j], new[j]
        row[j, MEAN], row[j, LEVEL], row[j, SHARE] = mean[j], level[j], share[j]
        row[j, LOAD], row[j, DAMPED] = load[j], damping[j]
        for i in range(row.shape[0]):
            row[j, DAMPED + 1 + i] = mass[j, i]


@kernel
def _simulate(
    parent: NDArray[np.int64],
    is_slide: NDArray[np.bool_],
    rotation: Array,
    translation: Array,
    gravity: Array,
    springs: Array,
    table: Array,
    command: Array,
    total: Array,
    kp: Array,
    kd: Array,
    start: int,
    rate: float,
    substeps: int,
    position: Array,
    velocity: Array,
    out_position: Array,
    out_velocity: Array,
    out_torque: Array,
    trace: Array,
) -> None:
    n, samples = is_slide.size, out_position.shape[0]
    h = 1.0 / (rate * substeps)
    links = np.zeros((n, PER_JOINT))
    copy_rows(table[:, :PER_JOINT], links)
    # Viscous and Coulomb friction are the step's own.
    links[:, 11] = 0.0
    links[:, 12] = 0.0
    # The drive's coordinate is the link's, but where there is play between them.
    drive = np.arange(n)
    size = n
    for j in range(n):
        if table[j, GAP] > 0.0:
            drive[j] = size
            size += 1
    q, v, a = np.zeros(size), np.zeros(size), np.zeros(size)
    q[:n], v[:n] = position, velocity
    new, rhs = np.empty(size), np.empty(size)
    u, level, share, play = np.zeros(n), np.empty(n), np.zeros(n), np.zeros(n)
    offset, damping, load, goal, followed = np.empty(n), np.empty(n), np.zeros(n), np.empty(n), np.empty(n)
    middle, speed, bias, scratch = np.empty(n), np.zeros(n), np.empty(n), np.empty((n, SCRATCH))
    mass, factor = np.empty((size, size)), np.empty((size, size))
    mass_and_bias(
        parent, is_slide, rotation, translation, gravity, springs, links, q, speed, scratch, mass, bias
    )
    for j in range(n):
        goal[j] = command[min(start, command.shape[0] - 1), j]
        if drive[j] >= n:
            # It hangs on the side that its weight pulls it to.
            play[j] = 0.5 * table[j, GAP] * np.sign(bias[j])
            if table[j, ENCODER_AFTER] == 0.0:
                q[j] -= play[j]
            q[drive[j]], v[drive[j]] = q[j] + play[j], v[j]
    for k in range(samples):
        if k > 0:
            for s in range(substeps):
                time = (start + k - 1 + s / substeps) / rate
                for j in range(n):
                    middle[j], speed[j] = q[j] + 0.5 * h * v[j], v[j] + 0.5 * h * a[j]
                mass_and_bias(
                    parent, is_slide, rotation, translation, gravity, springs, links, middle, speed,
                    scratch, mass, bias,
                )  # fmt: skip
                total_torque = 0.0
                for j in range(n):
                    total_torque += abs(u[j])
                for j in range(n):
                    d = drive[j]
                    late = time - table[j, DELAY]
                    mean = (
                        _held(command, total, j, late + h, rate) - _held(command, total, j, late, rate)
                    ) / h
                    if table[j, INVERSE_RATE] > 0.0:
                        most = h / table[j, INVERSE_RATE]
                        goal[j] += min(most, max(-most, mean - goal[j]))
                        mean = goal[j]
                    if table[j, COMMAND_STEP] > 0.0:
                        mean = table[j, COMMAND_STEP] * np.rint(mean / table[j, COMMAND_STEP])
                    followed[j] = mean
                    strength = max(LEAST_STRENGTH, 1.0 - table[j, SAG] * total_torque)
                    # Where the encoder sees the link, the motor's speed is not what the servo damps.
                    seen = j if table[j, ENCODER_AFTER] > 0.0 else d
                    offset[j], damping[j] = drive_torque(
                        table[j], kp[j], kd[j], mean, strength, q[seen], v[seen], a[seen], v[d], seen == d, h
                    )
                    level[j] = friction_level(table[j], middle[j], v[d], load[j])
                if size == n:
                    if not plain_step(
                        mass, factor, offset, damping, table, bias, level, h, v, new, rhs, share
                    ):
                        return
                elif not step_with_play(
                    mass,
                    factor,
                    offset,
                    damping,
                    table,
                    bias,
                    level,
                    h,
                    v,
                    new,
                    rhs,
                    share,
                    drive,
                    play,
                ):
                    return
                if trace.shape[0] > 0:
                    row = trace[(k - 1) * substeps + s]
                    _note(row, q, v, a, new, followed, level, share, load, damping, mass)
                for j in range(n):
                    d = drive[j]
                    mean_speed = 0.5 * (v[d] + new[d])
                    u[j] = offset[j] - damping[j] * mean_speed
                    motor = (new[d] - v[d]) / h
                    load[j] = u[j] - table[j, 11] * mean_speed - share[j] * level[j] - table[j, 10] * motor
                for j in range(n):
                    a[j] = (new[j] - v[j]) / h
                    q[j] += 0.5 * h * (v[j] + new[j])
                    v[j] = new[j]
                    d = drive[j]
                    if d != j:
                        a[d] = (new[d] - v[d]) / h
                        # The play is exact at its ends only by the speeds at the end of the step.
                        half = 0.5 * table[j, GAP]
                        play[j] = min(half, max(-half, play[j] + h * (new[d] - new[j])))
                        q[d] = q[j] + play[j]
                        v[d] = new[d]
                    if not (abs(v[j]) < RUNAWAY and abs(v[d]) < RUNAWAY):
                        return
        for j in range(n):
            seen = j if table[j, ENCODER_AFTER] > 0.0 else drive[j]
            out_position[k, j], out_velocity[k, j], out_torque[k, j] = q[seen], v[seen], u[j]
