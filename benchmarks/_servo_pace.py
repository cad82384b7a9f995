"""PACE's way: CMA-ES over armature, damping, friction, bias of each joint and one delay, by MuJoCo rollouts.

As github.com/leggedrobotics/pace-sim2real does it: sigma 0.5 in bounds scaled to ±1, from their middle,
until the population's scores differ by less than 1 % or for 200 generations; the end is the distribution's
mean. One step a sample, the delay in whole steps, on the command (its version 0.2). Gains are as stated.
"""

import copy
import os
from collections.abc import Sequence

import cmaes
import mujoco
import numpy as np
from mujoco import rollout
from numpy.typing import NDArray

from identification.output_error.servo_run import ServoRun

from ._servo_case import Case
from ._servo_mujoco import held_command, initial_state, servo_spec, start_of

Array = NDArray[np.float64]

# 256 is the least of its guide to population sizes; its own runs take 4096, on a graphics card.
POPULATION = 256
SIGMA, GENERATIONS, EPSILON = 0.5, 200, 1e-2
# Candidates that are simulated at once, which bounds memory.
AT_ONCE = 64


def fitted(case: Case) -> tuple[Array, str]:
    """The parameters (4 n + 1,) at the mean of the last generation."""
    lower, upper = _bounds(case)
    models = [_model(case, run) for run in case.fitted]
    optimiser = cmaes.CMA(
        mean=np.zeros(len(lower)),
        sigma=SIGMA,
        bounds=np.column_stack([-np.ones(len(lower)), np.ones(len(lower))]),
        seed=0,
        population_size=POPULATION,
    )
    for _ in range(GENERATIONS):
        asked = np.array([optimiser.ask() for _ in range(POPULATION)])
        scores = np.zeros(POPULATION)
        for first in range(0, POPULATION, AT_ONCE):
            part = slice(first, first + AT_ONCE)
            candidates = lower + (asked[part] + 1) / 2 * (upper - lower)
            for run, model in zip(case.fitted, models, strict=True):
                missed = _simulated(model, run, candidates) - run.position
                scores[part] += np.sum(missed**2, axis=(1, 2))
        optimiser.tell(list(zip(asked, scores, strict=True)))
        if np.ptp(scores) < EPSILON * scores.min():
            break
    how = f"armature, damping, friction, bias of each joint, one delay; {POPULATION} a generation, "
    return lower + (optimiser.mean + 1) / 2 * (upper - lower), how + f"{optimiser.generation} generations"


def predicted(case: Case, parameters: Array, run: ServoRun) -> Array:
    """Position (N, n) of a run, as the encoders would have it."""
    return _simulated(_model(case, run), run, parameters[None])[0]


def _bounds(case: Case) -> tuple[Array, Array]:
    n, own = case.robot.joints, case.bounds
    upper = np.repeat([own.armature, own.damping, own.friction, own.bias], n)
    lower = np.repeat([1e-5, 0.0, 0.0, -own.bias], n)
    # A whole number of steps is what it is cut to.
    return np.append(lower, 0.0), np.append(upper, own.delay)


def _model(case: Case, run: ServoRun) -> mujoco.MjModel:
    return servo_spec(case.robot, case.servo, run.kp, run.kd, 1 / run.rate).compile()


def _simulated(model: mujoco.MjModel, run: ServoRun, candidates: Array) -> Array:
    """Encoder positions (C, N, n) of parameters (C, 4 n + 1)."""
    n, (position, velocity) = model.nv, start_of(run)
    models, states, commands = [], [], []
    scratch: Sequence[mujoco.MjData] = [mujoco.MjData(model) for _ in range(os.cpu_count() or 1)]
    for own in candidates:
        one = copy.copy(model)
        one.dof_armature[:], one.dof_frictionloss[:] = own[:n], own[2 * n : 3 * n]
        one.dof_damping[:] = own[n : 2 * n]
        mujoco.mj_setConst(one, scratch[0])
        bias = own[3 * n : 4 * n]
        models.append(one)
        states.append(initial_state(model, position + bias, velocity))
        commands.append(held_command(run, 1, int(own[-1]) / run.rate) + bias)
    _, sensed = rollout.rollout(models, list(scratch), np.array(states), np.array(commands))
    start = np.broadcast_to(position, (len(candidates), 1, n))
    return np.concatenate([start, sensed - candidates[:, None, 3 * n : 4 * n]], axis=1)
