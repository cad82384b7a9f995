"""Which criterion: its cost alone, the whole design's, and what the motions are worth.

Every design goes through the same optimiser with the same starts, limits and clearance. Those named
``..._differences`` get the criterion's gradient by forward differences, as is the practice where no
exact one is at hand; their value costs no more than it must, and the limits keep their exact gradients.
"""

import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from identification.base_parameters import base_parameters
from identification.estimators import estimate
from identification.excitation.constraints import SmoothConstraints
from identification.excitation.criteria import CRITERIA, criterion_named, criterion_values
from identification.excitation.design import feasible_motions, optimise, torque_scale
from identification.excitation.excitation import DesignOptions
from identification.excitation.problem import DesignProblem, sampling_times, weighted_regressor
from identification.excitation.trajectories import trajectory_from_dict
from identification.excitation.trajectory import Trajectory
from identification.excitation.two_stage import design_two_stage

from ..clearance import RobotClearance
from ..jobs.excite import design_room
from ..robot import Robot
from ..scenario import Scenario
from .case import Case, Row
from .experiment import accuracy, experiment, robot_of, scenario_of

Array = NDArray[np.float64]

METRICS = ("relative_bound", "condition_number", "minus_logdet", "prediction_error", "seconds")
TWO_STAGE, ALONE = "hadamard_then_logdet", "criterion_alone"
DIFFERENCES = ("condition_differences", "logdet_differences")
STEP = 1e-6
# Timings of a criterion alone; the fastest counts.
REPEATS = 15


def choices() -> tuple[str, ...]:
    """The criteria, the two-stage design, and the rivals with finite differences."""
    return (*sorted(CRITERIA), TWO_STAGE, *DIFFERENCES)


def seeds_of(scenario: Scenario, choice: str) -> range:
    """Starts of a choice: fewer for those that take minutes."""
    section = scenario.comparison
    return range(section.difference_starts if choice in DIFFERENCES else section.repetitions)


def run(case: Case) -> Row:
    """One start of one choice, or every criterion's cost alone."""
    scenario, robot = scenario_of(case), robot_of(case)
    options = DesignOptions(
        trajectory=scenario.excitation.trajectory,
        harmonics=scenario.excitation.harmonics,
        base_frequency=scenario.excitation.base_frequency,
        groups=scenario.identification.parameters,
        starts=1,
        limit_share=scenario.excitation.limit_share,
        seed=case.seed,
    )
    section = scenario.excitation
    room = design_room(robot, section.limit_share, section.velocity_limit, section.clearance)
    robot, clearance = replace(robot, limits=room.limits), room.clearance
    if case.choice == ALONE:
        return _alone(robot, options)
    # Loads compiled kernels, so that the design is timed alone.
    _design(robot, clearance, "hadamard", replace(options, iterations=1))
    began = time.process_time()
    motion, evaluations = _design(robot, clearance, case.choice, options)
    seconds = time.process_time() - began
    if motion is None:
        return {"note": "this start found no motion that keeps the limits", "seconds": seconds}
    known = experiment(case, motion, trajectory_from_dict(case.settings["validation"]))
    found = estimate(known.problem, scenario.identification.estimator)
    base, scale = known.problem.base, _scale(robot, options)
    instants = sampling_times(_basis_of(robot, options))
    weighted = weighted_regressor(robot.chain, base.columns, scale, motion.evaluate(instants))
    values = criterion_values(weighted, len(instants))
    return accuracy(found, known) | {
        "seconds": seconds,
        "evaluations": evaluations,
        "relative_bound": known.relative(known.bound),
        "minus_hadamard": values.hadamard,
        "minus_logdet": values.logdet,
        "slack": values.slack,
        "condition_number": values.condition_number,
    }


def _design(
    robot: Robot, clearance: RobotClearance | None, choice: str, options: DesignOptions
) -> tuple[Trajectory | None, int]:
    """The motion of one start and the criterion's evaluations."""
    chain, parameters, limits = robot.chain, robot.parameters, robot.limits
    if choice == TWO_STAGE:
        return design_two_stage(chain, parameters, limits, options, clearance)
    motions = feasible_motions(chain, parameters, limits, options, clearance)
    columns = base_parameters(chain, options.groups).columns
    constraints = SmoothConstraints(chain, parameters, motions.limits, clearance)
    scale = torque_scale(motions, limits, options.seed)
    (generator,) = np.random.default_rng(options.seed).spawn(1)
    kind, criterion = DesignProblem, None
    if choice in DIFFERENCES:
        kind, criterion = _DifferenceProblem, VALUES[choice.removesuffix("_differences")]
    problem = kind(chain, motions.basis, columns, scale, criterion or criterion_named(choice), constraints)
    first = motions.draw(generator)
    _, motion, evaluations = optimise(
        problem, motions, first, options.iterations, lambda iteration, value: None
    )
    return motion, evaluations


class _DifferenceProblem(DesignProblem):
    """A design problem whose criterion has no exact gradient."""

    def gradient(self, z: Array) -> Array:
        """Forward differences of the criterion, one evaluation a variable."""
        here = self.value(z)
        return np.array([(self.value(z + step) - here) / STEP for step in STEP * np.eye(len(z))])


def _value_of_condition(weighted: Array, samples: int) -> tuple[float, Array]:
    gram, _ = _unit_gram(weighted)
    values = np.linalg.eigvalsh(gram)
    return 0.5 * float(np.log(values[-1] / max(values[0], np.finfo(float).tiny))), weighted[:0]


def _value_of_logdet(weighted: Array, samples: int) -> tuple[float, Array]:
    gram, norms = _unit_gram(weighted)
    return -float(np.linalg.slogdet(gram)[1] + np.sum(np.log(norms**2 / samples))), weighted[:0]


def _unit_gram(weighted: Array) -> tuple[Array, Array]:
    norms = np.linalg.norm(weighted, axis=0)
    gram = weighted.T @ weighted
    return gram / np.outer(norms, norms), norms


VALUES = {"condition": _value_of_condition, "logdet": _value_of_logdet}


def _alone(robot: Robot, options: DesignOptions) -> Row:
    """Milliseconds of each criterion's value on one regressor at 400 Hz, and with its exact gradient."""
    basis = _basis_of(robot, options)
    instants = np.arange(0.0, basis.duration, 1 / 400)
    motions = feasible_motions(robot.chain, robot.parameters, robot.limits, options, None)
    first = basis.trajectory(motions.draw(np.random.default_rng(options.seed)))
    columns = base_parameters(robot.chain, options.groups).columns
    weighted = weighted_regressor(robot.chain, columns, _scale(robot, options), first.evaluate(instants))
    samples = len(instants)
    row: Row = {"rows": len(weighted), "columns": len(columns)}
    for name, work in _alone_work(weighted, samples).items():
        work()
        row[f"{name}_ms"] = 1e3 * min(_seconds(work) for _ in range(REPEATS))
    return row


def _alone_work(weighted: Array, samples: int) -> dict[str, Callable[[], Any]]:
    work: dict[str, Callable[[], Any]] = {
        "hadamard": lambda: np.einsum("ij,ij->j", weighted, weighted),
        "logdet": lambda: _value_of_logdet(weighted, samples),
        "condition_by_eigenvalues": lambda: _value_of_condition(weighted, samples),
        "condition_by_svd": lambda: np.linalg.svd(
            weighted / np.linalg.norm(weighted, axis=0), compute_uv=False
        ),
    }
    for name, criterion in CRITERIA.items():
        work[f"{name}_with_gradient"] = partial(criterion, weighted, samples)
    return work


def _seconds(work: Callable[[], Any]) -> float:
    began = time.perf_counter()
    work()
    return time.perf_counter() - began


def _basis_of(robot: Robot, options: DesignOptions) -> Any:
    return feasible_motions(robot.chain, robot.parameters, robot.limits, options, None).basis


def _scale(robot: Robot, options: DesignOptions) -> Array:
    motions = feasible_motions(robot.chain, robot.parameters, robot.limits, options, None)
    return torque_scale(motions, robot.limits, options.seed)
