"""The job behind ``run``: scenario in, results folder out."""

import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from identification.differentiation import differentiation_methods
from identification.errors import InputError
from identification.estimators import estimators
from identification.excitation.design import DesignOptions, random_excitation
from identification.excitation.excitation import Excitation
from identification.models import Preprocessing, identification_models
from identification.parameters import GROUPS
from identification.pipeline import IdentificationOptions

from ..background import background
from ..comparison import compare_with_truth
from ..containment.folder import results_folder
from ..effects import injection
from ..estimate_file import write_estimate
from ..excitation_file import excitation_document, write_excitation
from ..files import require_writable
from ..log import Recording, write_log
from ..model_error import ModelError, nominal_model
from ..progress import Step, steps
from ..recording import write_session
from ..report import write_report
from ..results import IdentificationResult
from ..robot import Robot, load_robot, print_notes
from ..scenario import WRITTEN, Scenario, load_scenario
from ..simulation import (
    ControllerOptions,
    SensorOptions,
    SimulationOptions,
    controller_gains,
    sample_reference,
    simulate,
    tracking,
)
from ..summary import print_summary
from .excite import DesignRoom, design, design_room, print_peaks
from .identify import identify_recordings

# Streams drawn from a scenario's seed.
STREAMS = 5
DESIGN, VALIDATION, NOISE, BACKGROUND, MODEL_ERROR = range(STREAMS)

# Motions by what they follow from: variants that change nothing of it share one design.
Designs = dict[tuple[object, ...], tuple[Excitation, tuple[Excitation, ...]]]


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
    require_writable(folder / "excitation.json")
    designs: Designs = {}
    with results_folder(folder, WRITTEN):
        results = [
            _run_plan(plan, robots[place], place, path.name, jobs, designs) for place, plan in plans.items()
        ]
    return results[0]


def _robot(scenario: Scenario, path: Path) -> Robot:
    """The scenario's robot, with everything checked that can be before work starts."""
    section = scenario.identification
    for field, names, known in (
        ("model", (section.model,), identification_models()),
        ("estimator", (section.estimator,), estimators()),
        ("differentiation", (section.differentiation,), differentiation_methods()),
        ("parameters", section.parameters, GROUPS),
    ):
        for name in names:
            if name not in known:
                raise InputError(path, f"identification.{field}", "a known name", repr(name), sorted(known))
    if not section.parameters:
        raise InputError(path, "identification.parameters", "at least one group", "none", GROUPS)
    robot = load_robot(scenario.model, scenario.choice)
    try:
        simulation_options(scenario, robot)
    except InputError as error:
        raise error.located(path) from None
    return robot


def _run_plan(
    scenario: Scenario, robot: Robot, folder: Path, source: str, jobs: int | None, designs: Designs
) -> IdentificationResult:
    noise = _streams(scenario)[NOISE]
    with steps() as progress:
        with progress.step(f"{scenario.name}: design") as step:
            follows_from = (
                scenario.model,
                scenario.joints,
                scenario.fix_base,
                scenario.seed,
                scenario.excitation,
                scenario.validation,
                scenario.identification.parameters,
            )
            if follows_from not in designs:
                designs[follows_from] = _motions(scenario, robot, jobs, step)
            excitation, validations = designs[follows_from]
        write_excitation(excitation, folder / "excitation.json")
        with progress.step(f"{scenario.name}: simulate"):
            nominal = _nominal(scenario, robot, folder)
            fitted, validated = _simulate(
                scenario, robot, nominal, excitation, validations, noise, source, jobs
            )
        tracking_lines = _tracking(scenario, robot, nominal, fitted | validated)
        for name, recording in (fitted | validated).items():
            write_log(recording, folder / f"{name}.h5")
        with progress.step(f"{scenario.name}: identify"):
            sensors = simulation_options(scenario, robot).sensors
            result = _identified(scenario, nominal, sensors, fitted, validated)
        with progress.step(f"{scenario.name}: report"):
            write_estimate(result, folder / "estimate.json")
            write_report(result, folder / "report.html", excitation_document(excitation))
            write_session(result, folder / "session.rrd")
    print(f"{scenario.name}: {folder}")
    print_notes(robot)
    print_peaks(robot, excitation, _room(scenario, robot))
    for line in tracking_lines:
        print(line)
    print_summary(result)
    return result


def _motions(
    scenario: Scenario, robot: Robot, jobs: int | None, step: Step
) -> tuple[Excitation, tuple[Excitation, ...]]:
    """The motion to fit, and those to validate on."""
    streams = _streams(scenario)
    room = _room(scenario, robot)
    excitation = _design(scenario, robot, room, _integer(streams[DESIGN]), jobs, step)
    others = streams[VALIDATION].spawn(scenario.validation.runs)
    return excitation, tuple(_validation(scenario, robot, room, _integer(stream)) for stream in others)


def _room(scenario: Scenario, robot: Robot) -> DesignRoom:
    section = scenario.excitation
    return design_room(robot, section.limit_share, section.velocity_limit, section.clearance)


def _design(
    scenario: Scenario, robot: Robot, room: DesignRoom, seed: int, jobs: int | None, step: Step
) -> Excitation:
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
    return design(robot, room, section.criterion, options, jobs, step)


def _validation(scenario: Scenario, robot: Robot, room: DesignRoom, seed: int) -> Excitation:
    options = DesignOptions(
        harmonics=scenario.validation.harmonics,
        base_frequency=scenario.validation.base_frequency,
        groups=scenario.identification.parameters,
        limit_share=scenario.excitation.limit_share,
        seed=seed,
    )
    return random_excitation(robot.chain, robot.parameters, room.limits, options, room.clearance)


def _simulate(
    scenario: Scenario,
    robot: Robot,
    nominal: Robot,
    excitation: Excitation,
    validations: Sequence[Excitation],
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
        nominal=nominal,
        seed=stream.spawn(len(references)),
        threads=jobs,
    )
    origin = {"scenario": scenario.name, "scenario_file": source, "scenario_seed": scenario.seed}
    recordings = tuple(
        dataclasses.replace(recording, provenance=recording.provenance | origin) for recording in recordings
    )
    names = [f"validation_{index}" for index in range(1, len(validations) + 1)]
    return {"fit": recordings[0]}, dict(zip(names, recordings[1:], strict=True))


def _tracking(
    scenario: Scenario, robot: Robot, nominal: Robot, runs: Mapping[str, Recording]
) -> tuple[str, ...]:
    """Lines on the loop's gains and how it followed. Raises InputError for a run whose loop ran away."""
    options = simulation_options(scenario, robot)
    lines = controller_gains(options, nominal).reduced(options.controller.bandwidth, robot.joint_names)
    for name, recording in runs.items():
        followed = tracking(recording, nominal.limits.torque)
        followed.require_followed(f"{scenario.name}, {name}")
        lines += tuple(f"{name}: {line}" for line in followed.warnings())
    return lines


def _nominal(scenario: Scenario, robot: Robot, folder: Path) -> Robot:
    """The model that the controller knows: the robot's, or one drawn around it and written to the folder."""
    scale = scenario.model_error.scale
    if scale == 0:
        return robot
    stream = _streams(scenario)[MODEL_ERROR]
    return nominal_model(robot, ModelError().scaled(scale), stream, folder / "nominal.xml")


def simulation_options(scenario: Scenario, robot: Robot) -> SimulationOptions:
    """The simulation's options that a scenario asks for. Raises InputError for an impossible effect."""
    simulation = scenario.simulation
    effects = tuple(
        injection(robot, each.effect, each.joint, each.values, each.law, each.into)
        for each in scenario.effects
    )
    sensors = _sensors(scenario, robot)
    if scenario.background.scale > 0:
        healthy = background(robot, _streams(scenario)[BACKGROUND], scenario.background.scale)
        effects, sensors = effects + healthy.effects, healthy.sensors
    return SimulationOptions(
        controller=ControllerOptions(
            kind=simulation.controller, rate=simulation.control_rate, bandwidth=simulation.bandwidth
        ),
        sensors=sensors,
        physics_timestep=simulation.physics_timestep,
        effects=effects,
    )


def torque_noise_std(sensors: SensorOptions, robot: Robot) -> NDArray[np.float64]:
    """Standard deviation (n,) of the torque sensors, N·m (N)."""
    noise = np.broadcast_to(sensors.torque_noise, (robot.joints,))
    # A joint without a torque limit has no noise to scale with it.
    return noise * np.where(noise > 0, robot.limits.torque, 0.0)


def _sensors(scenario: Scenario, robot: Robot) -> SensorOptions:
    noise = scenario.noise
    return SensorOptions(
        encoder_bits=noise.encoder_bits or 0,
        slide_resolution=noise.slide_resolution,
        position_noise=noise.position,
        torque_noise=noise.torque,
        torque_correlation_time=noise.torque_correlation_time,
        torque_bias=noise.torque_bias * robot.limits.torque if noise.torque_bias else 0.0,
        torque_delay=noise.torque_delay,
    )


def _identified(
    scenario: Scenario,
    nominal: Robot,
    sensors: SensorOptions,
    fitted: dict[str, Recording],
    validated: dict[str, Recording],
) -> IdentificationResult:
    section = scenario.identification
    preprocessing = Preprocessing(section.cutoff, section.differentiation, section.dead_zone, section.model)
    options = IdentificationOptions(section.estimator, section.parameters, preprocessing)
    result = identify_recordings(nominal, fitted, validated, options)
    pole, correlation = 0.0, float(np.mean(np.asarray(sensors.torque_correlation_time, dtype=float)))
    if correlation > 0:
        pole = float(np.exp(-1 / (scenario.simulation.control_rate * correlation)))
    comparison = compare_with_truth(
        nominal.chain,
        result.estimate,
        tuple(fitted.values()),
        torque_noise_std(sensors, nominal),
        pole,
        preprocessing,
    )
    return dataclasses.replace(result, comparison=comparison)


def _streams(scenario: Scenario) -> list[np.random.SeedSequence]:
    """One stream for each thing that is drawn."""
    return np.random.SeedSequence(scenario.seed).spawn(STREAMS)


def _integer(stream: np.random.SeedSequence) -> int:
    """A seed for what takes an integer."""
    return int(stream.generate_state(1)[0])
