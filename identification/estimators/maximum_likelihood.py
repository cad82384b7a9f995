"""Maximum likelihood: errors in the positions are weighted as well as errors in the torques.

Swevers, Ganseman, Tükel, De Schutter & Van Brussel (1997), "Optimal robot excitation and
identification"; Olsen, Swevers & Verdonck (2002), "Maximum likelihood identification of a dynamic
robot model": minimise 1/2 sum e'(B S B')^-1 e with e = Y beta - tau and B = de/d(q, dq, ddq, tau).

With u = (B S B')^-1 e, the likeliest errors of the measured state x are d = S B'u, and the gradient
is Y(x - d)'u to first order: the corrected regressor is what removes the bias that a noisy one has.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular

from ..errors import InputError
from ..estimate import Estimate
from ..measurement_noise import state_noise, torque_variance
from ..observations import Observations
from ..problem import Problem
from ..regressor import regressor
from ..regressor_adjoint import regressor_adjoint
from . import wls

Array = NDArray[np.float64]

PASSES = 20
# Stop when the whole vector moves by less than this in the metric of its own information.
TOLERANCE = 1e-3


@dataclass(frozen=True)
class _Run:
    """One run's equations with the state they were written at.

    state: (3, M, n) q, dq, ddq. noise: (n, 3, 3) covariance of each joint's state errors.
    """

    observations: Observations
    state: Array
    noise: Array


def estimate(problem: Problem) -> Estimate:
    """beta = argmin 1/2 sum_k e_k'(B_k S B_k')^-1 e_k by Gauss-Newton from the weighted fit.

    The noise of the positions is read off the raw motions; what they do not explain of the weighted
    fit's residual is the torque's. Raises InputError for other models than the inverse dynamic.
    """
    if problem.preprocessing.model != "inverse_dynamic":
        raise InputError(
            "identification",
            "model",
            "inverse_dynamic for the estimator maximum_likelihood",
            repr(problem.preprocessing.model),
        )
    first = wls.estimate(problem)
    runs = [_run(problem, index) for index in range(len(problem.observations))]
    of_torque = _unexplained_variance(problem, runs, first.values)
    values = first.values
    for _ in range(PASSES):
        white = _linearised(problem, runs, values, of_torque)
        step, information = _step(white, values)
        values = values + step
        if np.linalg.norm(information @ step) <= TOLERANCE:
            break
    equal = np.ones(problem.equations)
    white = _linearised(problem, runs, values, of_torque)
    found = white.linear_estimate(values, equal, "maximum_likelihood")
    std, _ = problem.residual_std(values)
    return replace(found, noise_std=std, condition_number=problem.condition_number)


def _run(problem: Problem, index: int) -> _Run:
    """The state at the instants of the equations, and how noisy it is."""
    observations, motion = problem.observations[index], problem.motions[index]
    signals, noise = state_noise(motion, problem.preprocessing, seed=index)
    instants = np.round(observations.time * motion.sample_rate).astype(int)
    state = np.stack([signals.q[instants], signals.dq[instants], signals.ddq[instants]])
    return _Run(observations, state, noise)


def _unexplained_variance(problem: Problem, runs: Sequence[_Run], values: Array) -> Array:
    """Residual variance that position noise does not explain, (n,)."""
    std, _ = problem.residual_std(values)
    explained, counts = np.zeros(problem.equations), np.zeros(problem.equations)
    for run in runs:
        from_positions = _from_positions(_sensitivity(problem, run, values), run.noise)
        own = np.diagonal(from_positions, axis1=1, axis2=2)
        explained += np.sum(np.where(run.observations.used, own, 0.0), axis=0)
        counts += run.observations.used.sum(axis=0)
    # Noise-free data would leave nothing to divide by.
    return torque_variance(std**2, explained / np.maximum(counts, 1)) + np.finfo(float).tiny


def _linearised(problem: Problem, runs: Sequence[_Run], values: Array, of_torque: Array) -> Problem:
    """The whitened least-squares problem around ``values``: same residuals, corrected regressor."""
    covariances, corrected = [], []
    columns = problem.base.columns
    for run in runs:
        observations = run.observations
        sensitivity = _sensitivity(problem, run, values)
        covariance = _from_positions(sensitivity, run.noise) + np.diag(of_torque)
        used, residual = observations.used, observations.residual(values)
        both = used[:, :, None] & used[:, None, :]
        error = np.where(used, -residual, 0.0)[:, :, None]
        weighted = np.linalg.solve(np.where(both, covariance, np.eye(problem.equations)), error)[:, :, 0]
        shift = np.einsum("jab,tijb,ti->atj", run.noise, sensitivity, weighted)
        q, dq, ddq = run.state - shift
        change = regressor(problem.chain, q, dq, ddq, columns)
        q, dq, ddq = run.state
        change -= regressor(problem.chain, q, dq, ddq, columns)
        likeliest = observations.regressor + change
        covariances.append(covariance)
        corrected.append(replace(observations, regressor=likeliest, torque=likeliest @ values + residual))
    return replace(problem, observations=tuple(corrected)).whitened(covariances)


def _step(white: Problem, values: Array) -> tuple[Array, Array]:
    """Gauss-Newton step (b,) from ``values``, and the information's triangular root (b, b)."""
    rows, torque, _ = white.stacked
    norms = np.linalg.norm(rows, axis=0)
    upper = np.asarray(np.linalg.qr(np.column_stack([rows / norms, torque - rows @ values]), mode="r"))
    information = upper[:-1, :-1]
    return solve_triangular(information, upper[:-1, -1]) / norms, information * norms


def _sensitivity(problem: Problem, run: _Run, values: Array) -> Array:
    """B less its torque part: d(Y beta)/d(q, dq, ddq), (M, n, n, 3), equation by joint by derivative."""
    q, dq, ddq = run.state
    samples, n = q.shape
    out = np.empty((samples, n, n, 3))
    for equation in range(n):
        seeds = np.zeros((samples, n, problem.base.count))
        seeds[:, equation] = values
        bars = regressor_adjoint(problem.chain, q, dq, ddq, seeds, problem.base.columns)
        out[:, equation] = np.stack(bars, axis=2)
    return out


def _from_positions(sensitivity: Array, noise: Array) -> Array:
    """Covariance of the equations' errors that comes from the positions, (M, n, n)."""
    spread = np.einsum("tija,jab->tijb", sensitivity, noise)
    return np.einsum("tija,tkja->tik", spread, sensitivity)
