"""A drawn case simulated: the robot with its effects, and its healthy twin on the same motions."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from identification.excitation.design import random_excitation
from identification.inverse_dynamics import inverse_dynamics
from testbench.background import background
from testbench.clearance import robot_clearance
from testbench.effects.base import Injection
from testbench.excite import CLEARANCE
from testbench.log import Controller, Recording
from testbench.model_error import ModelError, nominal_model
from testbench.robot import Robot
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
class SimulatedCase:
    """Recordings of a case as they are told, and what only its maker knows.

    robot: the true one. nominal: the model that goes with the logs. given: runs to diagnose. hidden: one
    more. twin: given and hidden of the healthy robot. injections: the effects beside the background.
    together, alone: the first of the runs that are given, by ideal sensors, with all effects and with each
    alone. healthy: likewise with none.
    """

    robot: Robot
    nominal: Robot
    given: tuple[Recording, ...]
    hidden: Recording
    twin: tuple[Recording, ...]
    injections: tuple[Injection, ...]
    together: tuple[Recording, ...]
    alone: tuple[tuple[Recording, ...], ...]
    healthy: tuple[Recording, ...]


def simulated_case(
    scenario: BlindScenario, draw: Draw, stream: np.random.SeedSequence, nominal: Path, scratch: Path
) -> SimulatedCase:
    """Simulate a drawn case. nominal: MJCF to write. scratch: folder for the true robot's model.

    The twin has the same background, noise and motions. Raises InputError where the drawn effects make
    a robot that cannot be driven.
    """
    true, wrong, small, numbers, noise, telling = stream.spawn(6)
    section = scenario.robots[draw.robot]
    robot = robot_of(section.model)
    if section.error > 0:
        robot = nominal_model(robot, ModelError().scaled(section.error), true, scratch / "robot.xml")
    model = nominal_model(robot, ModelError().scaled(draw.nominal), wrong, nominal)
    references = _references(draw, model)
    injections = _injections(draw, robot, references, np.random.default_rng(numbers))
    rate = draw.rate
    sensors = _sensors(draw, robot)
    healthy: tuple[Injection, ...] = ()
    if draw.background > 0:
        found = background(robot, small, draw.background)
        sensors, healthy = found.sensors, found.effects
    options = SimulationOptions(
        controller=ControllerOptions(
            kind=draw.controller, rate=rate, bandwidth=draw.bandwidth, damping_ratio=draw.damping_ratio
        ),
        sensors=sensors,
        physics_timestep=scenario.runs.physics_timestep,
        effects=(*healthy, *injections),
    )
    twin = replace(options, effects=healthy)
    ideal = replace(options, sensors=SensorOptions())
    # With the same noise: what differs between case and twin is the effect.
    streams, count = noise.spawn(len(references)), len(references)
    alone = [replace(ideal, effects=(*healthy, each)) for each in injections]
    clean = [replace(ideal, effects=healthy), ideal, *(alone if len(alone) > 1 else [])]
    first = references[: min(MEASURED_RUNS, count - 1)]
    recordings = simulate(
        robot,
        [*references, *references, *first * len(clean)],
        [*[options] * count, *[twin] * count, *[each for each in clean for _ in first]],
        model,
        [*streams, *streams, *streams[: len(first)] * len(clean)],
        threads=1,
        beside=OUTSIDE,
    )
    told = [_told(recording, draw, telling) for recording in recordings]
    parts = [tuple(told[at : at + len(first)]) for at in range(2 * count, len(told), len(first))]
    return SimulatedCase(
        robot=robot,
        nominal=model,
        given=tuple(told[: count - 1]),
        hidden=told[count - 1],
        twin=tuple(told[count : 2 * count]),
        injections=injections,
        together=parts[1],
        alone=tuple(parts[2:]) if len(injections) > 1 else (parts[1],) * len(injections),
        healthy=parts[0],
    )


def _references(draw: Draw, model: Robot) -> tuple[Reference, ...]:
    """The motions, within the limits of the model, as whoever has only the model would choose them."""
    clearance = robot_clearance(model, CLEARANCE)
    return tuple(
        sample_reference(
            random_excitation(
                model.chain, model.parameters, model.limits, motion.options, clearance
            ).trajectory,
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


def _told(recording: Recording, draw: Draw, stream: np.random.SeedSequence) -> Recording:
    """The recording with the channels that this case logs, and nothing that only a simulation knows."""
    channels = draw.channels
    referenced = "reference" in channels
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
        controller=controller if referenced else Controller("unknown", controller.rate),
        provenance={"created": CREATED},
        is_slide=recording.is_slide,
    )


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
