"""Extended Kalman filter: the parameters as constant states of the arm that the torques drive.

Gautier & Poignet (2001), "Extended Kalman filtering and weighted least squares dynamic identification
of robot", Control Engineering Practice 9(12). See kalman.py. It starts from the nominal model, not
from a fit, and needs neither velocities nor accelerations.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..closed_loop import standard_candidate
from ..errors import InputError
from ..estimate import Estimate
from ..filtering import central_difference, decimation_step, edge_samples, noise_gain, zero_phase_lowpass
from ..kalman import extended_kalman_filter
from ..measurement_noise import position_noise_std
from ..observations import POSITION_BAND
from ..problem import Problem
from ..regressor import column_slots
from ..simulated_motion import require_torque_equations
from . import wls

Array = NDArray[np.float64]

# Deviation of the nominal model's base parameters: a share of their own size and one of what would make
# all the torque of the motion.
PRIOR, SMALLEST_PRIOR = 0.1, 0.01
# A filter that leaves the robots that could exist starts again with this share of that deviation.
NARROWER, ATTEMPTS = 0.3, 3
# The recording is filtered again from the parameters it gave, so that no linearisation is far off. Noise
# levels of each pass, as shares of the signals' RMS: at least what the linearisation and integration err by.
TORQUE_NOISE = (1e-1, 1e-3)
POSITION_NOISE = (1e-4, 1e-6)
# Deviation of a pass's start, in deviations that the pass before came to.
WIDENING = 5.0
# Narrowest dead zone, rad/s (m/s), and longest step of the integration, s.
NARROWEST, LONGEST_STEP = 0.02, 1e-3


@dataclass(frozen=True)
class _Run:
    """A run as the filter takes it: K positions (K, n), k torques (k (K - 1) + 1, n) to each step.

    velocity: (n,) at the first. acceleration: (K - 1, n) in the middle of each step. sample_time: s between
    torques. noise: (2, n) deviations of a position and of a step's mean torque. rms: (2, n) of position and
    torque. resting: (K - 1, n) bool, steps during which the joint's direction is in doubt.
    """

    position: Array
    torque: Array
    velocity: Array
    acceleration: Array
    stride: int
    sample_time: float
    noise: Array
    rms: Array
    resting: NDArray[np.bool_]


def estimate(problem: Problem) -> Estimate:
    """The parameters after the last sample of the last run; the covariance is the filter's own.

    The noise of positions and torques is read off the raw positions and off the residual of the weighted
    torque fit, which is used for nothing else. Raises InputError for other equations than the inverse
    dynamic model's, where joints follow others, and where the nominal model is so far off that the filter
    loses the mass matrix.
    """
    require_torque_equations(problem, "extended_kalman")
    # Where joints follow others, they say so before all else is done.
    _ = problem.chain.arrays
    fit = wls.estimate(problem)
    std, _ = problem.residual_std(fit.values)
    runs = [_run(problem, index, std) for index in range(len(problem.motions))]
    nominal = problem.base.values(problem.nominal)
    rows, torque, _ = problem.stacked
    whole = np.linalg.norm(torque) / np.linalg.norm(rows, axis=0)
    scale = PRIOR * np.abs(nominal) + SMALLEST_PRIOR * whole
    for attempt in range(ATTEMPTS):
        filtered = _passes(problem, runs, nominal, NARROWER**attempt * scale)
        if filtered is not None:
            break
    else:
        raise InputError(
            "identification",
            "model",
            "a nominal model near enough for the estimator extended_kalman",
            "a mass matrix that is not positive",
        )
    values, covariance = filtered
    found = problem.linear_estimate(values, np.ones(problem.equations), "extended_kalman")
    return replace(found, covariance=covariance)


def _passes(
    problem: Problem, runs: Sequence[_Run], nominal: Array, scale: Array
) -> tuple[Array, Array] | None:
    """Parameters and covariance after all passes, None where one failed; scale: (b,) deviation of nominal."""
    values, covariance = nominal, np.diag(scale**2)
    for levels in zip(POSITION_NOISE, TORQUE_NOISE, strict=True):
        # Wide enough that what the passes before learned counts for little, never beyond the first.
        information = np.linalg.inv(covariance / np.outer(scale, scale)) / WIDENING**2
        spread = np.asarray(np.linalg.inv(information + np.eye(len(scale))), dtype=np.float64)
        filtered = _filtered(problem, runs, values, spread, scale, levels)
        if filtered is None:
            return None
        values, covariance = filtered
    return values, covariance


def _run(problem: Problem, index: int, residual_std: Array) -> _Run:
    """The samples of a run; ``residual_std`` (n,) is that of the torque equations."""
    motion = problem.motions[index]
    rate = motion.sample_rate
    cutoff = problem.preprocessing.at(rate).cutoff
    band = POSITION_BAND * cutoff
    stride = decimation_step(rate, band)
    smooth = zero_phase_lowpass(motion.position, rate, band)
    velocity = central_difference(smooth, rate)
    acceleration = zero_phase_lowpass(central_difference(velocity, rate), rate, cutoff)
    edge = edge_samples(rate, band)
    steps = (len(velocity) - 2 * edge - 1) // stride
    inside = slice(edge, edge + stride * steps + 1)
    position, torque, velocity = motion.position[inside], motion.torque[inside], velocity[inside]
    # White noise averaged over a step of the filter.
    torque_noise = residual_std / noise_gain(rate, cutoff) / np.sqrt(stride)
    before, after = velocity[:-1:stride], velocity[stride::stride]
    dead_zone = _dead_zone(problem)
    slow = np.minimum(np.abs(before), np.abs(after)) <= dead_zone
    return _Run(
        position=np.ascontiguousarray(position[::stride]),
        torque=np.ascontiguousarray(torque),
        velocity=velocity[0],
        acceleration=np.ascontiguousarray(acceleration[inside][stride // 2 :: stride][:steps]),
        stride=stride,
        sample_time=1 / rate,
        noise=np.array([position_noise_std(motion, problem.preprocessing), torque_noise]),
        rms=np.array([np.std(position, axis=0), np.sqrt(np.mean(torque**2, axis=0))]),
        resting=slow | (before * after < 0),
    )


def _dead_zone(problem: Problem) -> Array:
    return np.full(problem.chain.joints, max(problem.preprocessing.dead_zone, NARROWEST))


def _filtered(
    problem: Problem,
    runs: Sequence[_Run],
    start: Array,
    spread: Array,
    scale: Array,
    levels: tuple[float, float],
) -> tuple[Array, Array] | None:
    """Parameters (b,) and covariance (b, b) after filtering all runs from ``start``, None where it failed.

    spread: covariance (b, b) of the start in units of ``scale``. levels: smallest noise of position and
    torque, as shares of their RMS.
    """
    n, chain, base = problem.chain.joints, problem.chain, problem.base
    slots, _ = column_slots(n, base.columns)
    constant = standard_candidate(base, problem.nominal, np.zeros(base.count))
    dead_zone = _dead_zone(problem)
    state = np.concatenate([np.zeros(2 * n), start / scale])
    covariance = np.zeros((len(state), len(state)))
    covariance[2 * n :, 2 * n :] = spread
    for run in runs:
        of_position, of_torque = np.maximum(run.noise, np.array(levels)[:, None] * run.rms) ** 2
        state[: 2 * n] = np.concatenate([run.position[0], run.velocity])
        covariance[: 2 * n] = covariance[:, : 2 * n] = 0.0
        covariance[range(n), range(n)] = of_position
        covariance[range(n, 2 * n), range(n, 2 * n)] = dead_zone**2
        substeps = int(np.ceil(run.sample_time / LONGEST_STEP - 1e-9))
        noise = (of_position, np.where(run.resting, run.rms[1] ** 2, of_torque))
        timing = (run.stride, run.sample_time, substeps)
        went_well = extended_kalman_filter(
            chain.arrays, base.columns, slots, run.position, run.torque, run.acceleration, timing, dead_zone,
            noise, scale, constant, state, covariance,
        )  # fmt: skip
        if not went_well or not np.all(np.isfinite(state)):
            return None
    return scale * state[2 * n :], covariance[2 * n :, 2 * n :] * np.outer(scale, scale)
