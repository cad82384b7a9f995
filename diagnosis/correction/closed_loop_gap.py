"""The gap in closed loop: the simulator run on the log's reference with the log's controller."""

import tempfile
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from identification.errors import InputError
from identification.filtering import edge_samples, zero_phase_lowpass
from testbench.effects import effect
from testbench.effects.base import Injection
from testbench.log import Recording
from testbench.robot import Robot
from testbench.simulation import ControllerOptions, Reference, SimulationOptions, simulate
from testbench.simulation.controller import KINDS

from ..data.run import filter_cutoff
from ..decision.findings import STAGES, Diagnosis
from .corrected_mjcf import corrected_simulator, reidentified_simulator, robot_with
from .forward_gap import ForwardGap

Array = NDArray[np.float64]

# So much of the logs is run, s, the first runs first: forward simulation shows, it does not decide.
MOST_SECONDS = 60.0
PHYSICS_TIMESTEP = 2e-4


def gap_as_given(
    robot: Robot, recordings: Mapping[str, Recording], jobs: int | None = None
) -> ForwardGap | None:
    """The gap of the model as given alone, which needs no diagnosis; None where no log has its loop.

    A run counts when it has a reference and a controller of a kind that the simulator knows. jobs: threads.
    """
    chosen = _chosen(recordings)
    if not chosen:
        return None
    gap = ForwardGap(tuple(chosen), sum(map(_length, chosen.values())), {}, {})
    return _with_stage(gap, STAGES[0], robot, lambda: (robot, ()), recordings, jobs)


def forward_gap(
    diagnosis: Diagnosis,
    recordings: Mapping[str, Recording],
    as_given: ForwardGap | None,
    jobs: int | None = None,
) -> ForwardGap | None:
    """The gap of the model as given, re-identified, and corrected; None where no log has its loop.

    as_given: of ``gap_as_given`` for the same recordings. jobs: threads.
    """
    if as_given is None:
        return None
    gap = as_given
    with tempfile.TemporaryDirectory() as folder:
        for stage in STAGES[1:]:
            of_stage = partial(_stage, diagnosis, stage, Path(folder))
            gap = _with_stage(gap, stage, diagnosis.robot, of_stage, recordings, jobs)
    return gap


def _chosen(recordings: Mapping[str, Recording]) -> dict[str, Recording]:
    """The first runs whose logs hold their control loop, one at least, up to a limit of time in all."""
    chosen: dict[str, Recording] = {}
    seconds = 0.0
    for name, recording in recordings.items():
        usable = _has_its_loop(recording) and len(recording.time) > 2 * _edge(recording)
        if usable and (not chosen or seconds + _length(recording) <= MOST_SECONDS):
            chosen[name] = recording
            seconds += _length(recording)
    return chosen


def _edge(recording: Recording) -> int:
    """Samples at either end that the filter leaves out."""
    return edge_samples(recording.sample_rate, filter_cutoff(recording.sample_rate))


def _length(recording: Recording) -> float:
    return float(recording.time[-1] - recording.time[0])


def _with_stage(
    gap: ForwardGap,
    name: str,
    nominal: Robot,
    stage: Callable[[], tuple[Robot, tuple[Injection, ...]]],
    recordings: Mapping[str, Recording],
    jobs: int | None,
) -> ForwardGap:
    """The gap with one more stage: a robot and what is injected. nominal: what its controller knows."""
    chosen = {run: recordings[run] for run in gap.runs}
    try:
        runs = _simulated(nominal, *stage(), chosen, jobs)
    except InputError as error:
        why = f"{error.field}: expected {error.expected}, got {error.got}"
        return replace(gap, failed=gap.failed | {name: why})
    motion, torque = _difference(runs, list(chosen.values()))
    return replace(gap, motion=gap.motion | {name: motion}, torque=gap.torque | {name: torque})


def _has_its_loop(recording: Recording) -> bool:
    controller = recording.controller
    return (
        controller is not None
        and controller.kind in KINDS
        and controller.kp is not None
        and controller.kd is not None
        and recording.reference_position is not None
    )


def _stage(diagnosis: Diagnosis, stage: str, folder: Path) -> tuple[Robot, tuple[Injection, ...]]:
    """The robot to simulate at a stage after the first, and what is injected into it."""
    of_stage = reidentified_simulator if stage == "parameters" else corrected_simulator
    simulator = of_stage(diagnosis)
    # An event is of one run, not of the robot.
    lasting = tuple(each for each in simulator.effects if not effect(each.effect).DESCRIPTION.is_event)
    return robot_with(diagnosis.robot, simulator.standard, folder), lasting


def _simulated(
    nominal: Robot,
    robot: Robot,
    effects: tuple[Injection, ...],
    recordings: Mapping[str, Recording],
    jobs: int | None,
) -> list[Recording]:
    """The recordings' references run in closed loop, with ideal sensors."""
    references, options = [], []
    for recording in recordings.values():
        controller = recording.controller
        assert controller is not None
        references.append(_reference(recording, controller.rate))
        loop = ControllerOptions(controller.kind, controller.rate, controller.kp, controller.kd)
        if controller.coulomb_smoothing is not None:
            loop = replace(loop, coulomb_smoothing=controller.coulomb_smoothing)
        substeps = max(1, round(1 / (controller.rate * PHYSICS_TIMESTEP)))
        step = 1 / (controller.rate * substeps)
        options.append(SimulationOptions(controller=loop, physics_timestep=step, effects=effects))
    return list(simulate(robot, references, options, nominal=nominal, threads=jobs))


def _reference(recording: Recording, rate: float) -> Reference:
    """The log's reference at the controller's rate."""
    position = recording.reference_position
    assert position is not None
    velocity, acceleration = recording.reference_velocity, recording.reference_acceleration
    time = recording.time
    if abs(recording.sample_rate / rate - 1) < 1e-9 and velocity is not None and acceleration is not None:
        return Reference(position, velocity, acceleration)
    spline = CubicSpline(time, position)
    grid = time[0] + np.arange(int((time[-1] - time[0]) * rate + 1e-6) + 1) / rate
    return Reference(spline(grid), spline(grid, 1), spline(grid, 2))


def _difference(simulated: list[Recording], logged: list[Recording]) -> tuple[Array, Array]:
    """RMS of simulated less logged position and torque a joint, (n,) each, edges of the filter left out."""
    motion: list[Array] = []
    torque: list[Array] = []
    for model, robot in zip(simulated, logged, strict=True):
        since = robot.time - robot.time[0]
        cutoff = filter_cutoff(robot.sample_rate)
        trim = _edge(robot)
        for ours, theirs, out in (
            (model.position, robot.position, motion),
            (model.torque, robot.torque, torque),
        ):
            at_samples = np.column_stack([np.interp(since, model.time, column) for column in ours.T])
            smooth = zero_phase_lowpass(at_samples - theirs, robot.sample_rate, cutoff)
            out.append(smooth[trim : len(smooth) - trim])
    rms = [np.sqrt(np.mean(np.concatenate(part) ** 2, axis=0)) for part in (motion, torque)]
    return rms[0], rms[1]
