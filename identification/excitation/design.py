"""Design of exciting motions: a criterion minimised over free coefficients under the robot's limits."""

import itertools
import os
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from ..base_parameters import base_parameters
from ..chain import Chain
from ..errors import InputError
from ..inverse_dynamics import inverse_dynamics
from .constraints import SmoothConstraints
from .criteria import CriterionValues, criterion_named, criterion_values
from .excitation import DesignOptions, Excitation
from .limits import Clearance, Limits, limit_margins, require_usable, share_of
from .problem import DesignProblem, sampling_times, weighted_regressor
from .random_motion import FeasibleMotions, resting_centres
from .trajectories import trajectory_basis
from .trajectory import Trajectory

Array = NDArray[np.float64]

# Change of a criterion (in nats) below which the optimiser stops.
TOLERANCE = 1e-3
FIRST_STEP = 0.1
VALUES_PER_PERIOD = 400


@dataclass(frozen=True)
class DesignProgress:
    """Where a design stands: this start (from 0) of ``starts``, its iteration, and the criterion now."""

    start: int
    starts: int
    iteration: int
    iterations: int
    value: float


def design_excitation(
    chain: Chain,
    parameters: Array,
    limits: Limits,
    criterion: str = "hadamard",
    options: DesignOptions | None = None,
    clearance: Clearance | None = None,
    progress: Callable[[DesignProgress], None] | None = None,
    threads: int | None = None,
) -> Excitation:
    """The best motion found from several random starts, by sequential quadratic programming (SLSQP).

    parameters: (14 n,) standard parameters that give the torque. criterion: a name in ``CRITERIA``.
    Rows of the base regressor are divided by the joints' torque limits. progress: called after every
    iteration, from the thread of that start. threads: starts at a time (all cores when None); the
    result does not depend on it. The limits are kept on the fine grid of ``limit_margins``.
    Raises InputError for an unknown criterion or trajectory and for limits that cannot be met.
    """
    began = time.perf_counter()
    options = options or DesignOptions()
    function = criterion_named(criterion)
    motions = feasible_motions(chain, parameters, limits, options, clearance)
    base = base_parameters(chain, options.groups)
    scale = torque_scale(motions, limits, options.seed)
    constraints = SmoothConstraints(chain, parameters, motions.limits, clearance)
    generators = np.random.default_rng(options.seed).spawn(options.starts)

    def run(start: int) -> tuple[float, Trajectory | None, int]:
        def report(iteration: int, value: float) -> None:
            if progress is not None:
                progress(DesignProgress(start, options.starts, iteration, options.iterations, value))

        problem = DesignProblem(chain, motions.basis, base.columns, scale, function, constraints)
        return optimise(problem, motions, motions.draw(generators[start]), options.iterations, report)

    with ThreadPoolExecutor(min(threads or os.cpu_count() or 1, options.starts)) as pool:
        results = list(pool.map(run, range(options.starts)))
    values = tuple(value for value, _, _ in results)
    motion = results[int(np.argmin(values))][1]
    if motion is None:
        raise _no_room()
    return Excitation(
        joint_names=chain.joint_names,
        trajectory=motion,
        criterion=criterion,
        values=_values(chain, base.columns, scale, motion),
        margins=limit_margins(chain, parameters, limits, motion, clearance),
        options=options,
        evaluations=sum(evaluations for _, _, evaluations in results),
        start_values=values,
        seconds=time.perf_counter() - began,
    )


def random_excitation(
    chain: Chain,
    parameters: Array,
    limits: Limits,
    options: DesignOptions | None = None,
    clearance: Clearance | None = None,
) -> Excitation:
    """A random motion that keeps the limits, each joint's amplitude as large as they allow.

    Not optimised: for validation runs. Of the options, starts and iterations have no effect.
    Raises InputError for limits that cannot be met.
    """
    began = time.perf_counter()
    options = options or DesignOptions()
    motions = feasible_motions(chain, parameters, limits, options, clearance)
    base = base_parameters(chain, options.groups)
    scale = torque_scale(motions, limits, options.seed)
    motion = _drawn(motions, options.seed)
    return Excitation(
        joint_names=chain.joint_names,
        trajectory=motion,
        criterion=None,
        values=_values(chain, base.columns, scale, motion),
        margins=limit_margins(chain, parameters, limits, motion, clearance),
        options=options,
        evaluations=0,
        start_values=(),
        seconds=time.perf_counter() - began,
    )


def random_motion(
    chain: Chain,
    parameters: Array,
    limits: Limits,
    options: DesignOptions,
    clearance: Clearance | None = None,
) -> Trajectory:
    """The trajectory of ``random_excitation`` alone, without its figures. Raises InputError as that does."""
    return _drawn(feasible_motions(chain, parameters, limits, options, clearance), options.seed)


def _drawn(motions: FeasibleMotions, seed: int) -> Trajectory:
    """A motion drawn, enlarged, and repaired. Raises InputError for limits that cannot be met."""
    coefficients = motions.enlarged(motions.draw(np.random.default_rng(seed)))
    motion = motions.repaired(motions.basis.trajectory(coefficients))
    if motion is None:
        raise _no_room()
    return motion


def optimise(
    problem: DesignProblem,
    motions: FeasibleMotions,
    first: Array,
    iterations: int,
    report: Callable[[int, float], None],
) -> tuple[float, Trajectory | None, int]:
    """The criterion reached from one start, its motion on the fine grid, and the evaluations it took."""
    z = problem.variables(first)
    found = _repaired(problem, motions, problem.coefficients(descend(problem, z, iterations, report)))
    # The start keeps the limits; it is what is left if the optimiser ends where they cannot be kept.
    if found[0] > problem.value(z):
        found = min(found, _repaired(problem, motions, first), key=lambda pair: pair[0])
    return *found, problem.evaluations


def descend(problem: DesignProblem, z: Array, iterations: int, report: Callable[[int, float], None]) -> Array:
    """The variables that the optimiser comes to from ``z``; limits are kept on the coarse grid only."""
    count = itertools.count(1)
    # SLSQP starts from a unit Hessian: so scaled, its first step is small against the limits.
    steepest = float(np.linalg.norm(problem.gradient(z)))
    if not 0 < steepest < np.inf:
        raise InputError("excitation", "parameters", "parameters that a motion can excite", "none")
    scale = FIRST_STEP / steepest

    def scaled_value(z: Array) -> float:
        return scale * problem.value(z)

    def scaled_gradient(z: Array) -> Array:
        return scale * problem.gradient(z)

    def after_iteration(xk: Array) -> None:
        report(next(count), problem.value(xk))

    constraints: Any = {
        "type": "ineq",
        "fun": problem.constraint_values,
        "jac": problem.constraint_gradients,
    }
    result = minimize(
        scaled_value,
        z,
        jac=scaled_gradient,
        method="SLSQP",
        bounds=[(-1.0, 1.0)] * len(z),
        constraints=constraints,
        callback=after_iteration,
        options={"maxiter": iterations, "ftol": scale * TOLERANCE},
    )
    return np.asarray(result.x)


def _repaired(
    problem: DesignProblem, motions: FeasibleMotions, coefficients: Array
) -> tuple[float, Trajectory | None]:
    """The motion with every limit kept on the fine grid, and its criterion; infinite where there is none."""
    motion = motions.repaired(motions.basis.trajectory(coefficients))
    if motion is None:
        return np.inf, None
    return problem.value(problem.variables(motions.basis.free_coefficients(motion))), motion


def feasible_motions(
    chain: Chain, parameters: Array, limits: Limits, options: DesignOptions, clearance: Clearance | None
) -> FeasibleMotions:
    """What draws motions within the share of the limits that the options allow. Raises InputError."""
    require_usable(chain, limits)
    basis = trajectory_basis(options.trajectory, options.base_frequency, options.harmonics)
    usable = share_of(limits, options.limit_share)
    centres = resting_centres(chain, parameters, usable, clearance, options.seed)
    return FeasibleMotions(chain, parameters, usable, basis, clearance, centres)


def torque_scale(motions: FeasibleMotions, limits: Limits, seed: int) -> Array:
    """Torque limits (n,); where a joint has none, the RMS torque of a random motion."""
    scale = limits.torque
    if np.all(np.isfinite(scale)):
        return scale
    coefficients = motions.draw(np.random.default_rng(seed))
    motion = motions.basis.trajectory(coefficients).evaluate(sampling_times(motions.basis))
    tau = inverse_dynamics(motions.chain, motions.parameters, *motion)
    rms = np.sqrt(np.mean(tau**2, axis=0))
    return np.where(np.isfinite(scale), scale, np.maximum(rms, 1e-6 * max(rms.max(), 1e-6)))


def _values(
    chain: Chain, columns: NDArray[np.int64], torque_scale: Array, motion: Trajectory
) -> CriterionValues:
    """All criteria of one period on a dense grid."""
    count = int(np.ceil(VALUES_PER_PERIOD * motion.highest_frequency * motion.duration))
    sampled = motion.evaluate(np.arange(count) * motion.duration / count)
    return criterion_values(weighted_regressor(chain, columns, torque_scale, sampled), count)


def _no_room() -> InputError:
    return InputError("limits", "excitation", "room to move about a configuration of rest", "next to none")
