"""How the simulated position depends on a robot's table: the derivative of every step, carried along.

With q' = q + h/2 v and v' = v + h/2 a, a step of servo_step.py solves r = 0 for the speed that follows,

    r = M(q') (new - v)/h + bias(q', v') + (damping + fv)(v + new)/2 - offset + share level,

which is linear in the links' parameters (the regressor) and simple in all else. Where a joint slides,
d new follows from dr = 0; where friction holds it, d new = 0. So one simulation and one pass over its steps
give the derivatives by all unknowns (Hairer, Norsett & Wanner, "Solving Ordinary Differential Equations I",
1993, I.14), as differences of infinitely small steps would.
"""

import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial

import numpy as np
from numpy.typing import NDArray

from ..chain import Chain
from ..forward_dynamics import factorise
from ..inverse_dynamics import inverse_dynamics
from ..kinematics import kernel
from ..parameters import ARMATURE, COULOMB, INERTIAL, OFFSET, PER_JOINT, VISCOUS
from ..regressor import regressor
from .drive_law import drive_slopes, friction_slopes
from .plant import COMMAND_STEP, DELAY, ENCODER_AFTER, GAP, INVERSE_RATE, SAG, WIDTH
from .servo_loop import (
    AT,
    BEFORE,
    DAMPED,
    LEVEL,
    LOAD,
    MEAN,
    NEW,
    SHARE,
    SPEED,
    STEP,
    Simulated,
    Window,
    substeps_of,
    traced,
)

Array = NDArray[np.float64]

# Entries of the table with a law or a state that is not carried along.
STATEFUL = (GAP, ENCODER_AFTER, COMMAND_STEP, INVERSE_RATE, SAG)
# rad and rad/s: differences of the inverse dynamics within a step.
DIFFERENCE = 1e-6
# Steps that are linearised at once, which bounds memory.
STRETCH = 2048


def is_smooth(table: Array, directions: Array) -> bool:
    """Whether ``tangent`` can carry the derivatives along: nothing stateful acts, or is to be found."""
    return not table[:, STATEFUL].any() and not directions[..., STATEFUL].any()


def tangents(
    chain: Chain,
    table: Array,
    directions: Array,
    windows: Sequence[Window],
    rate: float,
    threads: int | None = None,
) -> list[tuple[Simulated, Array]]:
    """``tangent`` of every window; the result does not depend on the number of threads."""
    workers = min(threads or os.cpu_count() or 1, len(windows))
    one = partial(tangent, chain, table, directions, rate=rate)
    if workers <= 1:
        return [one(window) for window in windows]
    with ThreadPoolExecutor(workers) as pool:
        return list(pool.map(one, windows))


def tangent(
    chain: Chain, table: Array, directions: Array, window: Window, rate: float
) -> tuple[Simulated, Array]:
    """A window simulated, and the derivatives (M, n, m) of its position along directions (m, n, WIDTH).

    table: (n, WIDTH). Where the simulation runs away, the rest is NaN.
    """
    simulated, trace = traced(chain, table, window, rate)
    substeps = substeps_of(rate, STEP)
    h, m, n = 1 / (rate * substeps), len(directions), chain.joints
    state, work = np.zeros((4, n, m)), np.empty((4, n, m))
    moved = np.zeros((len(trace) + 1, n, m))
    for first in range(0, len(trace), STRETCH):
        part = np.ascontiguousarray(trace[first : first + STRETCH])
        law, slopes = np.zeros((len(part), n, WIDTH)), np.zeros((len(part), n, 4))
        time = window.start / rate + (first + np.arange(len(part))) * h
        _slopes(part, time, table, window.command, window.kp, window.kd, rate, h, law, slopes)
        by_law = np.stack([law[:, joint] @ directions[:, joint].T for joint in range(n)], axis=1)
        linear = _linearised(chain, table, directions, part, h)
        _carry(part, table, *linear, by_law, slopes, h, state, work, moved[first + 1 :])
    return simulated, moved[::substeps]


def _linearised(
    chain: Chain, table: Array, directions: Array, trace: Array, h: float
) -> tuple[Array, Array, Array]:
    """Derivatives of the torque of motion in each step by positions and speeds, (S, n, n), and by the links
    along the directions, (S, n, m)."""
    n = chain.joints
    links = table[:, :PER_JOINT].copy()
    links[:, [VISCOUS, COULOMB]] = 0.0
    position = trace[..., AT] + 0.5 * h * trace[..., SPEED]
    speed = trace[..., SPEED] + 0.5 * h * trace[..., BEFORE]
    acceleration = (trace[..., NEW] - trace[..., SPEED]) / h
    moves = DIFFERENCE * np.vstack([np.zeros((1, 2 * n)), np.eye(2 * n)])
    torque = inverse_dynamics(
        chain,
        links.ravel(),
        (position + moves[:, None, :n]).reshape(-1, n),
        (speed + moves[:, None, n:]).reshape(-1, n),
        np.tile(acceleration, (2 * n + 1, 1)),
        threads=1,
    ).reshape(2 * n + 1, len(trace), n)
    slopes = np.moveaxis((torque[1:] - torque[0]) / DIFFERENCE, 0, 2)
    by_links = np.zeros((len(trace), n, len(directions)))
    inertial = directions[..., :INERTIAL].reshape(len(directions), -1)
    moving = np.flatnonzero(inertial.any(axis=1))
    if len(moving):
        columns = (PER_JOINT * np.arange(n)[:, None] + np.arange(INERTIAL)).ravel()
        rows = regressor(chain, position, speed, acceleration, columns, threads=1)
        by_links[..., moving] = (rows.reshape(-1, len(columns)) @ inertial[moving].T).reshape(
            len(trace), n, -1
        )
    by_links += directions[..., OFFSET].T
    return np.ascontiguousarray(slopes[..., :n]), np.ascontiguousarray(slopes[..., n:]), by_links


@kernel
def _command_at(command: Array, joint: int, time: float, rate: float) -> float:
    """The held command just before a time since its first sample."""
    index = int(np.floor(time * rate - 1e-9))
    return command[max(0, min(index, command.shape[0] - 1)), joint]


@kernel
def _slopes(
    trace: Array,
    time: Array,
    table: Array,
    command: Array,
    kp: Array,
    kd: Array,
    rate: float,
    h: float,
    law: Array,
    slopes: Array,
) -> None:
    """Derivatives of each step's drive and friction by the joints' rows of the table, (S, n, WIDTH), and by
    position, position in the middle, speed and load, (S, n, 4). time: (S,) s since the first sample."""
    for s in range(trace.shape[0]):
        for j in range(table.shape[0]):
            at, own, out = trace[s, j], table[j], law[s, j]
            middle = 0.5 * (at[SPEED] + at[NEW])
            stiffness = drive_slopes(
                own, kp[j], kd[j], at[MEAN], at[AT], at[SPEED], at[BEFORE], middle, h, out
            )
            # A delay that grows: at each end of the step the command is what it was just before.
            late = time[s] - own[DELAY]
            change = _command_at(command, j, late + h, rate) - _command_at(command, j, late, rate)
            out[DELAY] = stiffness * change / h
            by_position, by_speed, by_load = friction_slopes(
                own, at[AT] + 0.5 * h * at[SPEED], at[SPEED], at[LOAD], at[SHARE], out
            )
            out[ARMATURE], out[VISCOUS] = (at[NEW] - at[SPEED]) / h, middle
            slopes[s, j, 0], slopes[s, j, 1] = stiffness, by_position
            slopes[s, j, 2], slopes[s, j, 3] = by_speed, by_load


@kernel
def _carry(
    trace: Array,
    table: Array,
    by_position: Array,
    by_speed: Array,
    by_links: Array,
    by_law: Array,
    slopes: Array,
    h: float,
    state: Array,
    work: Array,
    out: Array,
) -> None:
    """Carry the derivatives (4, n, m) of position, speed, acceleration and load over a stretch of steps.

    work: (4, n, m). out: (S, n, m), of the positions after each step.
    """
    n, m = state.shape[1], state.shape[2]
    position, speed, acceleration, load = state[0], state[1], state[2], state[3]
    middle, ahead, motion, new = work[0], work[1], work[2], work[3]
    factor = np.empty((n, n))
    for s in range(trace.shape[0]):
        for j in range(n):
            for c in range(m):
                middle[j, c] = position[j, c] + 0.5 * h * speed[j, c]
                ahead[j, c] = speed[j, c] + 0.5 * h * acceleration[j, c]
        for j in range(n):
            by, resisted = slopes[s, j], trace[s, j, DAMPED] + table[j, VISCOUS]
            for c in range(m):
                motion[j, c] = by_links[s, j, c]
            for i in range(n):
                p, v = by_position[s, j, i], by_speed[s, j, i]
                for c in range(m):
                    motion[j, c] += p * middle[i, c] + v * ahead[i, c]
            _add_inertia(trace[s, j], j, -1.0 / h, 0.5 * h * resisted, speed, motion[j])
            for c in range(m):
                forced = by_law[s, j, c] + by[0] * position[j, c] + by[1] * middle[j, c]
                forced += (by[2] + 0.5 * resisted) * speed[j, c] + by[3] * load[j, c]
                new[j, c] = -h * (motion[j, c] + forced)
        _solve_free(trace[s], factor, new)
        for j in range(n):
            resisted = trace[s, j, DAMPED] + table[j, VISCOUS]
            _add_inertia(trace[s, j], j, 1.0 / h, 0.5 * h * resisted, new, motion[j])
        for j in range(n):
            for c in range(m):
                acceleration[j, c] = (new[j, c] - speed[j, c]) / h
                load[j, c] = motion[j, c] - table[j, 10] * acceleration[j, c]
                position[j, c] += 0.5 * h * (speed[j, c] + new[j, c])
                speed[j, c] = new[j, c]
                out[s, j, c] = position[j, c]


@kernel
def _add_inertia(at: Array, j: int, factor: float, resisted: float, speeds: Array, out: Array) -> None:
    """out (m,) += factor times row j of the mass matrix times speeds (n, m).

    at: the joint's row of the trace, in which the step's resistance is added to the diagonal.
    """
    for i in range(speeds.shape[0]):
        entry = factor * (at[DAMPED + 1 + i] - (resisted if i == j else 0.0))
        for c in range(speeds.shape[1]):
            out[c] += entry * speeds[i, c]


@kernel
def _is_held(at: Array) -> bool:
    """Whether friction holds a joint at rest at the end of a step."""
    return at[NEW] == 0.0 and at[LEVEL] > 0.0 and abs(at[SHARE]) < 1.0


@kernel
def _solve_free(step: Array, factor: Array, x: Array) -> None:
    """x (n, m) <- the solution of the step's matrix for it, zero where friction holds a joint.

    step: (n, TRACED and n) of the trace. factor: (n, n), scratch.
    """
    n, m = x.shape
    for j in range(n):
        held = _is_held(step[j])
        for i in range(n):
            free = not held and not _is_held(step[i])
            factor[j, i] = step[j, DAMPED + 1 + i] if free else (1.0 if i == j else 0.0)
        if held:
            for c in range(m):
                x[j, c] = 0.0
    factorise(factor, factor)
    for i in range(n):
        for j in range(i):
            for c in range(m):
                x[i, c] -= factor[i, j] * x[j, c]
        for c in range(m):
            x[i, c] /= factor[i, i]
    for i in range(n - 1, -1, -1):
        for j in range(i + 1, n):
            for c in range(m):
                x[i, c] -= factor[j, i] * x[j, c]
        for c in range(m):
            x[i, c] /= factor[i, i]
