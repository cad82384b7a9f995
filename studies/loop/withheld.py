"""The robot that a closed loop drives: what it is, its nominal model, and what it logs of a motion."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from diagnosis.experiment.discriminating_motion import LIMIT_SHARE as PROPOSED_SHARE
from identification.errors import InputError
from identification.excitation.design import random_excitation
from identification.excitation.excitation import DesignOptions, Excitation
from identification.excitation.trajectory import Trajectory
from testbench.clearance import robot_clearance
from testbench.jobs.excite import CLEARANCE
from testbench.jobs.run import simulation_options
from testbench.log import Recording
from testbench.model_error import ModelError, nominal_model
from testbench.robot import Robot, load_robot
from testbench.scenario import Scenario
from testbench.simulation import SimulationOptions, sample_reference, simulate

from .scenario import LoopScenario

# Streams drawn from a scenario's seed; each round has a noise of its own.
NOMINAL, FIRST, NOISE = range(3)


@dataclass(frozen=True)
class Withheld:
    """The true robot with all that acts on it, and the model that goes with its logs."""

    scenario: LoopScenario
    robot: Robot
    nominal: Robot
    options: SimulationOptions


def withheld(scenario: LoopScenario, source: Path, nominal: Path) -> Withheld:
    """The robot of a scenario. source: its file, for messages. nominal: MJCF to write.

    The same scenario gives the same robot. Raises InputError, before anything is written, for effects that
    its model cannot have.
    """
    robot = load_robot(scenario.model)
    shared = ("name", "model", "seed", "effects", "simulation", "noise", "background")
    try:
        options = simulation_options(Scenario(**{name: getattr(scenario, name) for name in shared}), robot)
    except InputError as error:
        raise error.located(source) from None
    strays = ModelError().scaled(scenario.model_error.scale)
    return Withheld(
        scenario, robot, nominal_model(robot, strays, _stream(scenario, NOMINAL), nominal), options
    )


def first_motions(robot: Withheld) -> tuple[Excitation, ...]:
    """Motions of the first round, within the limits of the nominal model. Raises InputError."""
    seeds = _stream(robot.scenario, FIRST).generate_state(robot.scenario.first.runs)
    return tuple(_random(robot, int(seed)) for seed in seeds)


def other_motion(robot: Withheld, number: int) -> Excitation:
    """Random motion of round ``number`` where it does not follow the proposal. Raises InputError."""
    (seed,) = _stream(robot.scenario, FIRST, number).generate_state(1)
    limit_share = PROPOSED_SHARE if robot.scenario.follow == "random" else None
    return _random(robot, int(seed), limit_share)


def _random(robot: Withheld, seed: int, limit_share: float | None = None) -> Excitation:
    """A random motion of the first kind. limit_share: instead of its own."""
    model, section = robot.nominal, robot.scenario.first
    options = DesignOptions(
        harmonics=section.harmonics,
        base_frequency=section.base_frequency,
        limit_share=section.limit_share if limit_share is None else limit_share,
        seed=seed,
    )
    clearance = robot_clearance(model, CLEARANCE)
    return random_excitation(model.chain, model.parameters, model.limits, options, clearance)


def recorded(
    robot: Withheld, motions: Sequence[Trajectory], number: int, jobs: int | None
) -> tuple[Recording, ...]:
    """Logs of the robot along the motions of round ``number``, without the simulation's true effects."""
    simulation = robot.scenario.simulation
    references = [sample_reference(motion, simulation.control_rate, simulation.periods) for motion in motions]
    streams = _stream(robot.scenario, NOISE, number).spawn(len(references))
    recordings = simulate(robot.robot, references, robot.options, robot.nominal, streams, threads=jobs)
    origin: dict[str, Any] = {"scenario": robot.scenario.name, "round": number}
    return tuple(
        replace(each, truth={}, truth_effects=[], source="robot", provenance=origin) for each in recordings
    )


def _stream(scenario: LoopScenario, *numbers: int) -> np.random.SeedSequence:
    return np.random.SeedSequence((scenario.seed, *numbers))
