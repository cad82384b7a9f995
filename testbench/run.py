"""The jobs behind ``run``, ``excite`` and ``simulate``: scenario in, results folder out."""

import dataclasses
import json
from pathlib import Path
from typing import Any

import numpy as np

from identification.errors import InputError
from identification.estimators import estimators
from identification.excitation.design import DesignOptions, DesignProgress, design_excitation, random_excitation
from identification.excitation.excitation import Excitation
from identification.models import Preprocessing
from identification.pipeline import IdentificationOptions

from .clearance import robot_clearance
from .comparison import compare_with_truth
from .estimate_file import write_estimate
from .excitation_file import excitation_document, read_trajectory, write_excitation
from .identify import identify_recordings
from .log import Recording, write_log
from .progress import Step, steps
from .recording import write_session
from .report import write_report
from .results import IdentificationResult
from .robot import Robot, load_robot
from .scenario import Scenario, load_scenario
from .simulation import ControllerOptions, SensorOptions, SimulationOptions, sample_reference, simulate
from .summary import print_summary

# Collision geoms are snug: what lies between them and the exterior, and the tracking error.
CLEARANCE = 0.03

# Streams drawn from a scenario's seed.
DESIGN, VALIDATION, NOISE = range(3)


def run_scenario(
    path: Path, out: Path | None = None, seed: int | None = None, jobs: int | None = None
) -> IdentificationResult:
    """Run a scenario and its variants; results go to ``out`` (logs/NAME), a variant's to its sub-folder.

    seed: instead of the scenario's. jobs: threads. Returns the result of the scenario itself.
    Raises InputError before anything is written when the scenario cannot be run.
    """
    scenario, variants = load_scenario(path)
    folder = out if out is not None else Path("logs") / scenario.name
    plans = {folder: scenario} | {folder / name: variant for name, variant in variants.items()}
    if seed is not None:
        plans = {place: plan.model_copy(update={"seed": seed}) for place, plan in plans.items()}
    robots = {place: _robot(plan, path) for place, plan in plans.items()}
    results = [_run_plan(plan, robots[place], place, path.name, jobs) for place, plan in plans.items()]
    return results[0]


def _robot(scenario: Scenario, path: Path) -> Robot:
    """The scenario's robot, with everything checked that can be before work starts."""
    known = estimators()
    if scenario.identification.estimator not in known:
        got = repr(scenario.identification.estimator)
        raise InputError(path, "identification.estimator", "an estimator", got, sorted(known))
    return load_robot(scenario.model)


def _run_plan(scenario: Scenario, robot: Robot, folder: Path, source: str, jobs: int | None) -> IdentificationResult:
    streams = np.random.SeedSequence(scenario.seed).spawn(3)
    with steps() as progress:
        with progress.step(f"{scenario.name}: design") as step:
            excitation = _design(scenario, robot, _integer(streams[DESIGN]), jobs, step)
            validations = [
                _validation(scenario, robot, _integer(stream))
                for stream in streams[VALIDATION].spawn(scenario.validation.runs)
            ]
        write_excitation(excitation, folder / "excitation.json")
        with progress.step(f"{scenario.name}: simulate"):
            fitted, validated = _simulate(scenario, robot, excitation, validations, streams[NOISE], source, jobs)
        for name, recording in (fitted | validated).items():
            write_log(recording, folder / f"{name}.h5")
        with progress.step(f"{scenario.name}: identify"):
            result = _identified(scenario, robot, fitted, validated)
        with progress.step(f"{scenario.name}: report"):
            write_estimate(result, folder / "estimate.json")
            write_report(result, folder / "report.html", excitation_document(excitation))
            write_session(result, folder / "session.rrd")
    print_summary(result)
    return result


def _design(scenario: Scenario, robot: Robot, seed: int, jobs: int | None, step: Step) -> Excitation:
    section = scenario.excitation
    options = DesignOptions(
        trajectory=section.trajectory,
        harmonics=section.harmonics,
        base_frequency=section.base_frequency,
        groups=scenario.identification.parameters,
        starts=section.starts,
        limit_share=section.limit_share,
        seed=seed,
    )
    return _designed(robot, section.criterion, options, jobs, step)


def _designed(robot: Robot, criterion: str, options: DesignOptions, jobs: int | None, step: Step) -> Excitation:
    done: dict[int, int] = {}

    def report(now: DesignProgress) -> None:
        done[now.start] = now.iteration
        step.update(sum(done.values()), now.starts * now.iterations, f"{criterion} {now.value:.2f}")

    try:
        return design_excitation(
            robot.chain,
            robot.parameters,
            robot.limits,
            criterion,
            options,
            robot_clearance(robot, CLEARANCE),
            report,
            jobs,
        )
    except InputError as error:
        raise error.located(robot.path) from None


def _validation(scenario: Scenario, robot: Robot, seed: int) -> Excitation:
    options = DesignOptions(
        harmonics=scenario.validation.harmonics,
        base_frequency=scenario.validation.base_frequency,
        groups=scenario.identification.parameters,
        limit_share=scenario.excitation.limit_share,
        seed=seed,
    )
    clearance = robot_clearance(robot, CLEARANCE)
    return random_excitation(robot.chain, robot.parameters, robot.limits, options, clearance)


def _simulate(
    scenario: Scenario,
    robot: Robot,
    excitation: Excitation,
    validations: list[Excitation],
    stream: np.random.SeedSequence,
    source: str,
    jobs: int | None,
) -> tuple[dict[str, Recording], dict[str, Recording]]:
    """Recordings by name: those to fit, those to validate on; simulated as one batch."""
    rate = scenario.simulation.control_rate
    references = [sample_reference(excitation.trajectory, rate, scenario.simulation.periods)]
    references += [sample_reference(validation.trajectory, rate) for validation in validations]
    recordings = simulate(
        robot,
        references,
        simulation_options(scenario, robot),
        seed=stream.spawn(len(references)),
        threads=jobs,
    )
    told = {"scenario": scenario.name, "scenario_file": source, "scenario_seed": scenario.seed}
    recordings = tuple(
        dataclasses.replace(recording, provenance=recording.provenance | told) for recording in recordings
    )
    names = [f"validation_{index}" for index in range(1, len(validations) + 1)]
    return {"fit": recordings[0]}, dict(zip(names, recordings[1:], strict=True))


def simulation_options(scenario: Scenario, robot: Robot) -> SimulationOptions:
    """The simulation's options that a scenario asks for."""
    noise, simulation = scenario.noise, scenario.simulation
    bits = noise.encoder_bits or 0
    bias = noise.torque_bias * robot.limits.torque if noise.torque_bias else 0.0
    return SimulationOptions(
        controller=ControllerOptions(kind=simulation.controller, rate=simulation.control_rate),
        sensors=SensorOptions(
            encoder_bits=bits,
            slide_resolution=noise.slide_resolution,
            position_noise=noise.position,
            torque_noise=noise.torque,
            torque_correlation_time=noise.torque_correlation_time,
            torque_bias=bias,
            torque_delay=noise.torque_delay,
        ),
        physics_timestep=simulation.physics_timestep,
    )


def _identified(
    scenario: Scenario, robot: Robot, fitted: dict[str, Recording], validated: dict[str, Recording]
) -> IdentificationResult:
    section = scenario.identification
    preprocessing = Preprocessing(section.cutoff, section.differentiation, section.dead_zone)
    options = IdentificationOptions(section.estimator, section.parameters, preprocessing)
    result = identify_recordings(robot, fitted, validated, options)
    pole = 0.0
    if scenario.noise.torque_correlation_time > 0:
        pole = float(np.exp(-1 / (scenario.simulation.control_rate * scenario.noise.torque_correlation_time)))
    comparison = compare_with_truth(
        robot.chain,
        result.estimate,
        tuple(fitted.values()),
        scenario.noise.torque * robot.limits.torque,
        pole,
        preprocessing,
    )
    return dataclasses.replace(result, comparison=comparison)


def _integer(stream: np.random.SeedSequence) -> int:
    """A seed for what takes an integer."""
    return int(stream.generate_state(1)[0])


def excite_model(
    model: Path,
    out: Path,
    criterion: str,
    harmonics: int,
    base_frequency: float,
    starts: int,
    limit_share: float,
    seed: int,
    jobs: int | None,
) -> Excitation:
    """Design an excitation for a model and write it to ``out`` as JSON. Raises InputError."""
    robot = load_robot(model)
    options = DesignOptions(
        harmonics=harmonics, base_frequency=base_frequency, starts=starts, limit_share=limit_share, seed=seed
    )
    with steps() as progress, progress.step("design") as step:
        excitation = _designed(robot, criterion, options, jobs, step)
    write_excitation(excitation, out)
    print(json.dumps(_headline(excitation)))
    return excitation


def _headline(excitation: Excitation) -> dict[str, Any]:
    values = excitation.values
    return {
        "hadamard": round(values.hadamard, 3),
        "logdet": round(values.logdet, 3),
        "condition_number": round(values.condition_number, 2),
        "slack": round(values.slack, 3),
        "limits_kept": excitation.margins.kept,
    }


def simulate_model(
    model: Path,
    trajectory: Path,
    out: Path,
    periods: int,
    controller: str,
    encoder_bits: int | None,
    torque_noise: float,
    seed: int,
    jobs: int | None,
) -> Recording:
    """Drive a model along a trajectory file and write the robot-log to ``out``. Raises InputError."""
    robot = load_robot(model)
    joint_names, motion = read_trajectory(trajectory)
    if joint_names != robot.joint_names:
        expected = f"the model's joints {', '.join(robot.joint_names)}"
        raise InputError(trajectory, "joint_names", expected, ", ".join(joint_names))
    options = SimulationOptions(
        controller=ControllerOptions(kind=controller),
        sensors=SensorOptions(
            encoder_bits=encoder_bits or 0,
            slide_resolution=1e-6 if encoder_bits else 0.0,
            torque_noise=torque_noise,
        ),
        physics_timestep=2e-4,
    )
    reference = sample_reference(motion, options.controller.rate, periods)
    with steps() as progress, progress.step("simulate"):
        (recording,) = simulate(robot, [reference], options, seed=seed, threads=jobs)
    told = {"trajectory": trajectory.name}
    recording = dataclasses.replace(recording, provenance=recording.provenance | told)
    write_log(recording, out)
    return recording
