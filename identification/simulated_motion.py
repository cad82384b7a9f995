"""A problem's runs simulated at an estimate, and the equations written along them."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from .closed_loop import SimulatedRun, standard_candidate
from .errors import InputError
from .inverse_dynamics import mass_matrices
from .models import equations
from .observations import Observations
from .problem import Problem
from .signals import Signals

Array = NDArray[np.float64]

# Configurations of each run at which the mass matrix is checked.
POSES = 64
# Of the nominal mass matrix, in the worst direction: below it an explicit step may be unstable.
SMALLEST_INERTIA = 0.2


def require_torque_equations(problem: Problem, estimator: str) -> None:
    """Raise InputError unless the equations are those of the inverse dynamic model."""
    if problem.preprocessing.model != "inverse_dynamic":
        raise InputError(
            "identification",
            "model",
            f"inverse_dynamic for the estimator {estimator}",
            repr(problem.preprocessing.model),
        )


def simulate_values(
    problem: Problem, candidates: Array, coarse: bool = False
) -> list[tuple[SimulatedRun, ...]]:
    """Every run for each candidate, base values (C, b); ``coarse`` is quicker, for their differences.

    Raises InputError when the logs cannot be simulated.
    """
    if problem.closed_loop is None:
        raise InputError(
            "logs", "reference and controller", "both, for an estimator that simulates the robot", "none"
        )
    standard = [standard_candidate(problem.base, problem.nominal, values) for values in candidates]
    return problem.closed_loop.simulate(np.array(standard), coarse)


def simulated_equations(problem: Problem, runs: Sequence[SimulatedRun]) -> tuple[Observations, ...]:
    """The measured torque against the regressor along simulated runs, at the instants of the problem's.

    Both pass the filters of the inverse dynamic model. The rows used are the problem's own: by the
    simulated velocity they would change from pass to pass, and the estimate never settle.
    """
    out = []
    for run, motion, simulated in zip(problem.observations, problem.motions, runs, strict=True):
        trim = round(float(run.time[0]) * motion.sample_rate)
        signals = Signals(simulated.q, simulated.dq, simulated.ddq, motion.torque, motion.sample_rate, trim)
        settings = problem.preprocessing.at(motion.sample_rate)
        written = equations(problem.chain, problem.base, signals, settings, run.name)
        out.append(replace(written, used=run.used))
    return tuple(out)


def simulatable(problem: Problem, values: Array) -> Array:
    """``values`` (b,), moved towards the nominal model until the mass matrix allows a simulation.

    Inertia estimated from noisy data need not be positive along the whole motion.
    """
    nominal = problem.base.values(problem.nominal)
    share = 1.0
    while share > 1e-3:
        trial = nominal + share * (values - nominal)
        if _smallest_inertia(problem, trial) > SMALLEST_INERTIA:
            return trial
        share /= 2
    return nominal


def _smallest_inertia(problem: Problem, values: Array) -> float:
    """Smallest eigenvalue of the mass matrix against the nominal one, over poses of the runs."""
    q = np.concatenate([run.q[:: max(1, len(run.q) // POSES)] for run in problem.observations])
    ours, nominal = (
        mass_matrices(problem.chain, standard, q)
        for standard in (standard_candidate(problem.base, problem.nominal, values), problem.nominal)
    )
    factor = np.linalg.cholesky(nominal)
    half = np.linalg.solve(factor, ours)
    relative = np.linalg.solve(factor, half.transpose(0, 2, 1))
    return float(np.linalg.eigvalsh(0.5 * (relative + relative.transpose(0, 2, 1))).min())
