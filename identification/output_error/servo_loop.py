"""Position servos simulated on a logged command, many candidates and windows as one batch.

Each step is the midpoint rule with the servo and viscous friction implicit, and Coulomb friction as the
impulse that opposes the velocity after the step (Moreau's time stepping; Acary & Brogliato, "Numerical
Methods for Nonsmooth Dynamical Systems", 2008, ch. 10): a joint slides against it or sticks, and steps
may be as long as a sample of the drive.
"""

import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..chain import Chain
from ..forward_dynamics import factorise, solve
from ..inverse_dynamics import _inverse_dynamics
from ..kinematics import kernel
from ..parameters import PER_JOINT
from .plant import DELAY, EXTRA, KD_SCALE, KP_SCALE, LIMIT, LOAD_FRICTION, STRIBECK_VELOCITY

Array = NDArray[np.float64]

# s, longest step.
STEP = 2.5e-3
# rad/s (m/s) by which velocities may miss the friction law, and sweeps to get there.
VELOCITY_TOLERANCE, SWEEPS = 1e-13, 100
# rad/s: what runs away faster is no robot any more.
RUNAWAY = 1e4


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
    substeps = max(1, int(np.ceil(1 / (rate * step) - 1e-9)))
    held = {id(window.command): _summed(window.command, rate) for window in windows}
    out = [
        [Simulated(*np.full((3, w.stop - w.start, chain.joints), np.nan)) for w in windows] for _ in tables
    ]

    def one(index: tuple[int, int]) -> None:
        candidate, window = index
        w, into = windows[window], out[candidate][window]
        _simulate(
            *chain.arrays, np.ascontiguousarray(tables[candidate]), w.command, held[id(w.command)],
            w.kp, w.kd, w.start, rate, substeps, w.position, w.velocity,
            into.position, into.velocity, into.torque,
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
) -> None:
    n, samples = is_slide.size, out_position.shape[0]
    h = 1.0 / (rate * substeps)
    links = np.zeros((n, PER_JOINT))
    links[:, :] = table[:, :PER_JOINT]
    # Viscous and Coulomb friction are the step's own.
    links[:, 11] = 0.0
    links[:, 12] = 0.0
    q, v, a = position.copy(), velocity.copy(), np.zeros(n)
    new, rhs, u, level, share = np.empty(n), np.empty(n), np.zeros(n), np.empty(n), np.zeros(n)
    offset, damping, load = np.empty(n), np.empty(n), np.zeros(n)
    rows_q, rows_v, rows_a = np.zeros((n + 1, n)), np.zeros((n + 1, n)), np.zeros((n + 1, n))
    torques, rest, nothing = np.empty((n + 1, n)), np.empty((1, n)), np.zeros((1, n))
    mass, factor = np.empty((n, n)), np.empty((n, n))
    for k in range(samples):
        if k > 0:
            for s in range(substeps):
                time = (start + k - 1 + s / substeps) / rate
                for j in range(n):
                    middle, speed = q[j] + 0.5 * h * v[j], v[j] + 0.5 * h * a[j]
                    for r in range(n + 1):
                        rows_q[r, j] = middle
                        rows_v[r, j] = speed if r == n else 0.0
                        rows_a[r, j] = 1.0 if r == j else 0.0
                _inverse_dynamics(
                    parent, is_slide, rotation, translation, gravity, springs, links, 0.0,
                    rows_q, rows_v, rows_a, torques,
                )  # fmt: skip
                _inverse_dynamics(
                    parent, is_slide, rotation, translation, gravity, springs, links, 0.0,
                    rows_q[:1], rows_v[:1], nothing, rest,
                )  # fmt: skip
                # Row n is the bias of the motion; the others are unit accelerations from rest.
                for i in range(n):
                    for j in range(n):
                        mass[i, j] = torques[j, i] - rest[0, i]
                for j in range(n):
                    late = time - table[j, DELAY]
                    mean = (
                        _held(command, total, j, late + h, rate) - _held(command, total, j, late, rate)
                    ) / h
                    stiffness = table[j, KP_SCALE] * kp[j]
                    offset[j] = stiffness * (mean - q[j])
                    damping[j] = table[j, KD_SCALE] * kd[j] + 0.5 * h * stiffness
                    expected = offset[j] - damping[j] * (v[j] + 0.5 * h * a[j])
                    if abs(expected) > table[j, LIMIT]:
                        offset[j] = table[j, LIMIT] if expected > 0 else -table[j, LIMIT]
                        damping[j] = 0.0
                    slip = v[j] / table[j, STRIBECK_VELOCITY]
                    level[j] = (
                        table[j, 12]
                        + table[j, EXTRA] * np.exp(-slip * slip)
                        + table[j, LOAD_FRICTION] * abs(load[j])
                    )
                if not _step(mass, factor, offset, damping, table, torques[n], level, h, v, new, rhs, share):
                    return
                for j in range(n):
                    mean_speed = 0.5 * (v[j] + new[j])
                    u[j] = offset[j] - damping[j] * mean_speed
                    a[j] = (new[j] - v[j]) / h
                    load[j] = u[j] - table[j, 11] * mean_speed - share[j] * level[j] - table[j, 10] * a[j]
                    q[j] += h * mean_speed
                    v[j] = new[j]
                    if not abs(v[j]) < RUNAWAY:
                        return
        for j in range(n):
            out_position[k, j], out_velocity[k, j], out_torque[k, j] = q[j], v[j], u[j]


@kernel
def _step(
    mass: Array,
    factor: Array,
    offset: Array,
    damping: Array,
    table: Array,
    bias: Array,
    level: Array,
    h: float,
    v: Array,
    new: Array,
    rhs: Array,
    share: Array,
) -> bool:
    """The velocity after a step into ``new``; the share of the highest friction that acts into ``share``.

    (M + h/2 D) new = M v + h (u - bias) - h/2 D v - h share level, |share| <= 1, against the velocity.
    False where M is not positive definite.
    """
    n = v.size
    for i in range(n):
        own = damping[i] + table[i, 11]
        rhs[i] = h * (offset[i] - bias[i]) - 0.5 * h * own * v[i]
        for j in range(n):
            rhs[i] += mass[i, j] * v[j]
    for i in range(n):
        mass[i, i] += 0.5 * h * (damping[i] + table[i, 11])
    if not factorise(mass, factor):
        return False
    # With the friction of the step before: exact where nothing stops or starts.
    for i in range(n):
        new[i] = rhs[i] - share[i] * h * level[i]
    solve(factor, new)
    # Coordinate descent on 1/2 new' M new - rhs' new + sum h level |new|, which is convex.
    for _ in range(SWEEPS):
        moved = 0.0
        for i in range(n):
            force = rhs[i]
            for j in range(n):
                if j != i:
                    force -= mass[i, j] * new[j]
            most = h * level[i]
            impulse = min(most, max(-most, force))
            share[i] = impulse / most if most > 0.0 else 0.0
            value = (force - impulse) / mass[i, i]
            moved = max(moved, abs(value - new[i]))
            new[i] = value
        if moved < VELOCITY_TOLERANCE:
            break
    return True
