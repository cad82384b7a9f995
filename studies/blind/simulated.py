"""A drawn case simulated: the robot with its effects, and its healthy twin on the same motions."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from identification.excitation.design import random_motion
from identification.inverse_dynamics import inverse_dynamics
from identification.parameters import ARMATURE, COULOMB, PER_JOINT, VISCOUS
from testbench.background import background
from testbench.clearance import robot_clearance
from testbench.effects.base import Injection
from testbench.jobs.excite import CLEARANCE
from testbench.log import Controller, Recording
from testbench.model_error import ModelError, nominal_model
from testbench.model_file import write_model
from testbench.robot import Robot, load_robot
from testbench.simulation import (
    ControllerOptions,
    Reference,
    SensorOptions,
    SimulationOptions,
    sample_reference,
    simulate,
)

from .draw import OUTSIDE_SIZE, Draw, robot_of
from .outside import OUTSIDE, outside_values
from .scenario import BlindScenario
from .values import drawn_injection

Array = NDArray[np.float64]

# The velocity that a drive reports: the encoder's difference through a first-order low-pass, Hz.
VELOCITY_CUTOFF = 80.0
# A gearbox warms by this much when its friction gives its usual power, degC, over this time, s.
AMBIENT, WARMING, WARMING_TIME = 25.0, 8.0, (20.0, 90.0)
TEMPERATURE_STEP = 0.1
# How much torque an effect moves is measured along so many of the runs that are given.
MEASURED_RUNS = 2
# All logs bear one date: when they were written says nothing.
CREATED = "2000-01-01T00:00:00+00:00"


@dataclass(frozen=True)
class PlannedCase:
    """A case before its logs.

    robot: the true one. model: what its drives know of it. nominal: the model that goes with the logs.
    references: of the runs that are given, then of the hidden one; streams: of the noise of each. injections:
    the effects beside the background. healthy: options of the twin, which has the same background.
    log_stream: of the channels logged beside position and torque.
    """

    draw: Draw
    robot: Robot
    model: Robot
    nominal: Robot
    references: tuple[Reference, ...]
    streams: tuple[np.random.SeedSequence, ...]
    injections: tuple[Injection, ...]
    healthy: SimulationOptions
    log_stream: np.random.SeedSequence


@dataclass(frozen=True)
class IdealRuns:
    """The first of the runs that are given, by ideal sensors: with all effects, each alone, and none."""

    together: tuple[Recording, ...]
    alone: tuple[tuple[Recording, ...], ...]
    healthy: tuple[Recording, ...]


@dataclass(frozen=True)
class SimulatedCase:
    """Logs of a case. given: runs to diagnose. hidden: one more. twin: all of them without effects."""

    given: tuple[Recording, ...]
    hidden: Recording
    twin: tuple[Recording, ...]


def planned_case(
    scenario: BlindScenario, draw: Draw, stream: np.random.SeedSequence, nominal: Path, scratch: Path
) -> PlannedCase:
    """The robot, its model and its motions. nominal: MJCF to write. scratch: folder for the true model.

    Raises InputError where the model leaves no room to move, or an effect cannot be put into the robot.
    """
    true, wrong, small, numbers, noise, log_stream = stream.spawn(6)
    section = scenario.robots[draw.robot]
    robot = robot_of(section.model)
    if section.error > 0:
        robot = nominal_model(robot, ModelError().scaled(section.error), true, scratch / "robot.xml")
    known = scratch / "known.xml" if draw.links_alone else nominal
    model = given = nominal_model(robot, ModelError().scaled(draw.nominal), wrong, known)
    if draw.links_alone:
        write_model(model, _links_alone(model), nominal)
        given = load_robot(nominal)
    references = _references(draw, model)
    sensors = _sensors(draw, robot)
    effects: tuple[Injection, ...] = ()
    if draw.background > 0:
        found = background(robot, small, draw.background)
        sensors, effects = found.sensors, found.effects
    return PlannedCase(
        draw=draw,
        robot=robot,
        model=model,
        nominal=given,
        references=references,
        streams=tuple(noise.spawn(len(references))),
        injections=_injections(draw, robot, references, np.random.default_rng(numbers)),
        healthy=SimulationOptions(
            controller=ControllerOptions(
                kind=draw.controller,
                rate=draw.rate,
                bandwidth=draw.bandwidth,
                damping_ratio=draw.damping_ratio,
            ),
            sensors=sensors,
            physics_timestep=scenario.runs.physics_timestep,
            effects=effects,
        ),
        log_stream=log_stream,
    )


def ideal_runs(case: PlannedCase) -> IdealRuns:
    """Ideal logs of the first runs, with and without effects. Raises InputError where it cannot be driven."""
    first = range(min(MEASURED_RUNS, len(case.references) - 1))
    ideal = replace(case.healthy, sensors=SensorOptions())
    several = case.injections if len(case.injections) > 1 else ()
    kinds = [(), case.injections, *((each,) for each in several)] if case.injections else [()]
    recordings = _simulated(case, [(ideal, kind, run) for kind in kinds for run in first])
    healthy, *ill = (recordings[at : at + len(first)] for at in range(0, len(recordings), len(first)))
    together = ill[0] if ill else healthy
    return IdealRuns(together, tuple(ill[1:]) if several else (together,) * len(case.injections), healthy)


def simulated_case(case: PlannedCase) -> SimulatedCase:
    """The logs of a case and of its twin. Raises InputError where the robot cannot be driven.

    The twin has the same noise: what differs is the effect. Without effects it is the case.
    """
    count = len(case.references)
    kinds = [case.injections, ()] if case.injections else [()]
    recordings = _simulated(case, [(case.healthy, kind, run) for kind in kinds for run in range(count)])
    given = tuple(
        _held(recording, case.draw.held, stream)
        for recording, stream in zip(recordings[: count - 1], case.log_stream.spawn(count - 1), strict=True)
    )
    return SimulatedCase(given, recordings[count - 1], recordings[-count:])


def _simulated(
    case: PlannedCase, runs: Sequence[tuple[SimulationOptions, tuple[Injection, ...], int]]
) -> tuple[Recording, ...]:
    """A recording a run, as logged; runs: options of the healthy robot, effects beside these, motion."""
    recordings = simulate(
        case.robot,
        [case.references[index] for _, _, index in runs],
        [replace(options, effects=(*options.effects, *added)) for options, added, _ in runs],
        case.model,
        [case.streams[index] for _, _, index in runs],
        threads=1,
        beside=OUTSIDE,
    )
    return tuple(_logged(recording, case.draw, case.log_stream) for recording in recordings)


def _references(draw: Draw, model: Robot) -> tuple[Reference, ...]:
    """The motions, within the limits of the model, as whoever has only the model would choose them."""
    clearance = robot_clearance(model, CLEARANCE)
    return tuple(
        sample_reference(
            random_motion(model.chain, model.parameters, model.limits, motion.options, clearance),
            draw.rate,
            motion.periods,
        )
        for motion in draw.motions
    )


def _injections(
    draw: Draw, robot: Robot, references: Sequence[Reference], rng: np.random.Generator
) -> tuple[Injection, ...]:
    """The drawn effects with their numbers, from what the motions that are given need."""
    given = references[:-1]
    torques = [
        inverse_dynamics(robot.chain, robot.parameters, each.position, each.velocity, each.acceleration)
        for each in given
    ]
    found = []
    for each in draw.effects:
        if each.effect in OUTSIDE:
            assert each.joint is not None
            needed = np.concatenate([torque[:, each.joint] for torque in torques])
            share = OUTSIDE_SIZE[0] + each.severity * (OUTSIDE_SIZE[1] - OUTSIDE_SIZE[0])
            size = share * float(np.sqrt(np.mean(needed**2)))
            values = outside_values(each.effect, size, each.joint, given, rng)
            found.append(Injection(each.effect, each.joint, values))
        else:
            assert each.law is not None
            place = (each.joint, each.into)
            found.append(drawn_injection(robot, each.effect, place, each.law, each.severity, torques, rng))
    return tuple(found)


def _sensors(draw: Draw, robot: Robot) -> SensorOptions:
    return SensorOptions(
        encoder_bits=draw.encoder_bits,
        slide_resolution=draw.slide_resolution,
        torque_noise=np.where(np.isfinite(robot.limits.torque), draw.torque_noise, 0.0),
        torque_correlation_time=draw.torque_correlation_time,
    )


def _logged(recording: Recording, draw: Draw, stream: np.random.SeedSequence) -> Recording:
    """The recording with the channels that this case logs, and nothing that only a simulation knows."""
    channels = draw.channels
    referenced = "reference" in channels
    # Gains are logged with the model that the drives have, which is not the one given with links alone.
    is_known = referenced and not draw.links_alone
    controller = recording.controller
    assert controller is not None
    return Recording(
        robot=recording.robot,
        joint_names=recording.joint_names,
        sample_rate=recording.sample_rate,
        source="robot",
        time=recording.time,
        position=recording.position,
        torque=recording.torque,
        velocity=_velocity(recording) if "velocity" in channels else None,
        torque_command=recording.torque_command if "torque_command" in channels else None,
        temperature=_temperature(recording, stream) if "temperature" in channels else None,
        reference_position=recording.reference_position if referenced else None,
        reference_velocity=recording.reference_velocity if referenced else None,
        reference_acceleration=recording.reference_acceleration if referenced else None,
        controller=controller if is_known else Controller("unknown", controller.rate),
        provenance={"created": CREATED},
        is_slide=recording.is_slide,
    )


def _held(recording: Recording, share: float, stream: np.random.SeedSequence) -> Recording:
    """The recording with this share of its samples, now and then, as the one before: late packets."""
    late = np.random.default_rng(stream).random(len(recording.time)) < share
    late[:1] = False
    if not late.any():
        return recording
    last = np.maximum.accumulate(np.where(late, 0, np.arange(len(late))))
    measured = ("position", "torque", "velocity", "torque_command", "temperature")
    channels = {name: getattr(recording, name) for name in measured}
    return replace(recording, **{name: each[last] for name, each in channels.items() if each is not None})


def _links_alone(robot: Robot) -> Array:
    """Standard parameters (14 n,) without friction and rotors."""
    table = robot.parameters.reshape(-1, PER_JOINT).copy()
    table[:, [ARMATURE, VISCOUS, COULOMB]] = 0.0
    return table.ravel()


def _velocity(recording: Recording) -> Array:
    rate = recording.sample_rate
    pole = float(np.exp(-2 * np.pi * VELOCITY_CUTOFF / rate))
    steps = np.diff(recording.position, axis=0, prepend=recording.position[:1]) * rate
    return lfilter([1 - pole], [1.0, -pole], steps, axis=0)


def _temperature(recording: Recording, stream: np.random.SeedSequence) -> Array:
    """Each gearbox warmed by its own friction, as read by a sensor with a coarse step."""
    rng = np.random.default_rng(stream)
    power = np.abs(recording.truth["friction_torque"] * recording.truth["velocity"])
    usual = np.maximum(power.mean(axis=0), 1e-12)
    start = AMBIENT + rng.uniform(-3.0, 3.0)
    warm = np.empty_like(power)
    for joint in range(power.shape[1]):
        pole = 1 - 1 / (recording.sample_rate * rng.uniform(*WARMING_TIME))
        warm[:, joint] = lfilter([1 - pole], [1.0, -pole], power[:, joint] / usual[joint])
    return TEMPERATURE_STEP * np.round((start + WARMING * warm) / TEMPERATURE_STEP)
