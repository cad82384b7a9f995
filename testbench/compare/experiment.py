"""One simulated identification with a known truth: the ground that every comparison stands on."""

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from identification.base_parameters import base_parameters
from identification.estimate import Estimate
from identification.excitation.trajectories import trajectory_from_dict
from identification.excitation.trajectory import Trajectory
from identification.models import Preprocessing, observe
from identification.problem import Problem
from identification.regressor import regressor

from ..closed_loop import recorded_loops
from ..comparison import cramer_rao
from ..jobs.run import simulation_options, torque_noise_std
from ..log import Recording
from ..model_error import ModelError, nominal_parameters
from ..model_reading.reading import Choice
from ..robot import Robot, load_robot
from ..sampling import motion
from ..scenario import Scenario
from ..simulation import sample_reference, simulate
from .case import Case, Row

Array = NDArray[np.float64]

# Hz at which a validation motion is sampled.
VALIDATION_RATE = 100.0
# A call quicker than this is timed again: the first loads compiled kernels.
SHORT = 3.0


@dataclass(frozen=True)
class Experiment:
    """A simulated run and what is known of it.

    problem: as an estimator sees it. recording: the log, with its truth. truth, bound: (b,) base values and
    their Cramér-Rao deviations. validation: (V, n, b) base regressor along a motion that is not fitted.
    """

    problem: Problem
    recording: Recording
    truth: Array
    bound: Array
    validation: Array

    def relative(self, deviation: Array) -> float:
        """Median of deviations (b,) over the true values, of those that are not zero."""
        known = self.truth != 0
        return float(np.median(deviation[known] / np.abs(self.truth[known])))


def robot_of(case: Case) -> Robot:
    """The robot of a case, read once a process. A recorded robot is no scenario's: all that its file has."""
    choice = scenario_of(case).choice if "scenario" in case.settings else Choice()
    packages = tuple((name, str(folder)) for name, folder in choice.packages.items())
    return _robot(case.files["model"], choice.joints, choice.fix_base, packages)


@cache
def _robot(
    path: str, joints: tuple[str, ...] | None, fix_base: bool, packages: tuple[tuple[str, str], ...]
) -> Robot:
    folders = {name: Path(folder) for name, folder in packages}
    return load_robot(Path(path), Choice(joints, fix_base, folders))


def scenario_of(case: Case) -> Scenario:
    """The scenario that a case's settings describe."""
    return Scenario.model_validate(case.settings["scenario"] | {"model": case.files["model"]})


def described(scenario: Scenario) -> dict[str, Any]:
    """A scenario as settings of a case: JSON types, without what no result follows from."""
    return scenario.model_dump(mode="json", exclude={"model", "comparison"}) | {"name": "case"}


def experiment(case: Case, fitted: Trajectory, validation: Trajectory) -> Experiment:
    """Simulate ``fitted`` with the noise of the case's seed and write its identification problem."""
    scenario, robot = scenario_of(case), robot_of(case)
    noise, wrong = np.random.SeedSequence((scenario.seed, case.seed)).spawn(2)
    nominal = robot
    if scenario.model_error.scale > 0:
        error = ModelError().scaled(scenario.model_error.scale)
        nominal = replace(robot, parameters=nominal_parameters(robot, error, wrong))
    options = simulation_options(scenario, robot)
    reference = sample_reference(fitted, scenario.simulation.control_rate, scenario.simulation.periods)
    (recording,) = simulate(robot, [reference], options, nominal, [noise], threads=1)
    section = scenario.identification
    preprocessing = Preprocessing(section.cutoff, section.differentiation, section.dead_zone, section.model)
    base = base_parameters(robot.chain, section.parameters)
    run = motion(recording)
    problem = Problem(
        chain=robot.chain,
        base=base,
        observations=(observe(robot.chain, base, run, preprocessing),),
        motions=(run,),
        preprocessing=preprocessing,
        nominal=nominal.parameters,
        closed_loop=recorded_loops(nominal, (recording,), threads=1),
    )
    bound = cramer_rao(robot.chain, base, [recording], torque_noise_std(options.sensors, robot), 0.0)
    instants = np.arange(0.0, validation.duration, 1 / VALIDATION_RATE)
    rows = regressor(robot.chain, *validation.evaluate(instants), base.columns, threads=1)
    return Experiment(problem, recording, base.values(robot.parameters), bound, rows)


def motions_of(case: Case) -> tuple[Trajectory, Trajectory]:
    """The motions to fit and to validate on, where a case is given both."""
    fit, validation = (trajectory_from_dict(case.settings[name]) for name in ("fit", "validation"))
    return fit, validation


def accuracy(found: Estimate, known: Experiment) -> Row:
    """How near an estimate came.

    parameter_error: median |error| / |truth|. over_bound: median |error| over that of normal errors at
    the Cramér-Rao bound. prediction_error: torque error along the validation motion, free of its noise,
    over RMS torque, RMS over joints. inside: share of parameters within two stated deviations.
    """
    error = np.abs(found.values - known.truth)
    torque = known.validation @ known.truth
    wrong = known.validation @ (found.values - known.truth)
    relative = np.sqrt(np.mean(wrong**2, axis=0) / np.mean(torque**2, axis=0))
    over_bound = None
    if np.all(known.bound > 0):
        # Half of all normal errors are below 0.6745 deviations.
        over_bound = float(np.median(error / known.bound) / 0.6745)
    return {
        "parameter_error": known.relative(error),
        "over_bound": over_bound,
        "prediction_error": float(np.sqrt(np.mean(relative**2))),
        "inside": float(np.mean(error <= 2 * found.std)),
        "condition_number": found.condition_number,
    }


def timed(work: Callable[[], Any]) -> tuple[Any, float]:
    """What ``work`` returns and the processor seconds it took, the better of two where it is quick."""
    began = time.process_time()
    found = work()
    seconds = time.process_time() - began
    if seconds < SHORT:
        began = time.process_time()
        found = work()
        seconds = min(seconds, time.process_time() - began)
    return found, seconds
