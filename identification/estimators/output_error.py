"""Closed-loop output error: the parameters whose simulated motion is the measured one.

Gautier, Janot & Vandanjon (2013), "A new closed-loop output error method for parameter identification
of robot dynamics", IEEE TCST 21(2): minimise sum |q - q_sim(beta)|² under the same reference and
controller. The measured torque has no part in it but for the start.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..estimate import Estimate
from ..filtering import decimation_step, edge_samples, zero_phase_lowpass
from ..observations import Observations
from ..problem import Problem
from ..simulated_motion import simulatable, simulate_values
from . import wls

Array = NDArray[np.float64]

ITERATIONS = 4
# Stop when no parameter moves by more than this share of its deviation, or of its scale.
TOLERANCE, SCALE_TOLERANCE = 0.2, 1e-4
# Step of a difference and longest step of an iteration, in units of the scale.
DIFFERENCE, LONGEST_STEP = 1e-3, 0.3


def estimate(problem: Problem) -> Estimate:
    """beta = argmin sum_j |q_j - q_sim,j(beta)|² / s_j² by Gauss-Newton from the weighted torque fit.

    s_j is the deviation of joint j's position residual. The Jacobian is by forward differences, all
    of them one batch of simulations. Raises InputError when the logs tell no reference or controller.
    """
    scale = _scale(problem)
    values = simulatable(problem, wls.estimate(problem).values)
    for _ in range(ITERATIONS):
        linear = _linearised(problem, values, DIFFERENCE * scale)
        weights = linear.residual_weights(linear.weighted_least_squares(np.ones(linear.equations)))
        step = linear.weighted_least_squares(weights) - values
        step *= min(1.0, LONGEST_STEP / max(float(np.max(np.abs(step) / scale)), LONGEST_STEP))
        found = linear.linear_estimate(simulatable(problem, values + step), weights, "output_error")
        moved, values = np.abs(found.values - values), found.values
        if np.all(moved <= np.maximum(TOLERANCE * found.std, SCALE_TOLERANCE * scale)):
            break
    std, _ = problem.residual_std(values)
    return replace(found, noise_std=std, condition_number=problem.condition_number)


def _scale(problem: Problem) -> Array:
    """Change (b,) of each parameter that makes as much torque as the arm moves with, joints pooled."""
    rows, torque, _ = problem.stacked
    return np.linalg.norm(torque) / np.linalg.norm(rows, axis=0)


def _linearised(problem: Problem, values: Array, steps: Array) -> Problem:
    """The problem q - q_sim(values) + J values = J beta, rows filtered and decimated like the equations."""
    candidates = values + np.vstack([np.zeros(len(values)), np.diag(steps)])
    (exact,) = simulate_values(problem, values[None])
    simulated = simulate_values(problem, candidates, coarse=True)
    runs = []
    for index, (run, motion) in enumerate(zip(problem.observations, problem.motions, strict=True)):
        rate = motion.sample_rate
        cutoff = problem.preprocessing.at(rate).cutoff
        edge, step = edge_samples(rate, cutoff), decimation_step(rate, cutoff)
        kept = slice(edge, len(motion.position) - edge, step)
        nominal = simulated[0][index].q
        jacobian = np.stack(
            [
                zero_phase_lowpass(candidate[index].q - nominal, rate, cutoff)[kept] / size
                for candidate, size in zip(simulated[1:], steps, strict=True)
            ],
            axis=2,
        )
        error = zero_phase_lowpass(motion.position - exact[index].q, rate, cutoff)[kept]
        runs.append(
            Observations(
                name=run.name,
                time=np.arange(len(nominal))[kept] / rate,
                q=exact[index].q[kept],
                dq=exact[index].dq[kept],
                regressor=jacobian,
                torque=error + jacobian @ values,
                used=np.ones(error.shape, dtype=bool),
                sample_rate=rate / step,
            )
        )
    return replace(problem, observations=tuple(runs))
