"""Torque delay: every joint's torque, or that of one alone, acts later than it is reported."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..robot import Robot
from .action import (
    DRIVE,
    STEP,
    Action,
    SimulatedRobot,
    Stage,
    bus_row,
    hook,
    hook_kernel,
    require_joint,
    vector,
)
from .base import EffectDescription, EffectParameter, Injection, Scope
from .columns import by_run
from .experiment import Experiment
from .mjcf_form import drive
from .signature import Family, Logged, Member, Quantity, grid_family

Array = NDArray[np.float64]

DESCRIPTION = EffectDescription(
    name="torque_delay",
    title="Torque delay",
    law="true torque(t) = reported torque(t - delay), the same delay on every joint, or on one alone",
    reference='Östring, Gunnarsson & Norrlöf, "Closed-loop identification of an industrial robot '
    'containing flexibilities", Control Engineering Practice 11(3), 2003',
    scope=Scope.ROBOT,
    parameters=(EffectParameter("delay", "s", 0.0, 0.05, (0.0002, 0.01)),),
    confused_with=("actuator_lag", "joint_elasticity"),
    shown_by=(Experiment.HIGH_FREQUENCIES,),
    late=True,
    relinearised=True,
    of_friction=True,
    or_of_one_joint=True,
    # Torque and position are sampled up to two milliseconds apart, and a torque may be as old as a sample.
    healthy=12.0,
    # Of one joint alone it is judged as a lag of its drive.
    healthy_alone=4.5,
    of_sample=1.0,
)

# Seconds. The difference over one of them determines delays within this factor of it.
GRID = (0.0005, 0.00125, 0.003, 0.0075, 0.02)
NEAR = 1.6


def action(injection: Injection, simulated: SimulatedRobot) -> Action:
    """A ring buffer of drive torques a joint, at the rate of the physics, interpolated between steps."""
    steps = injection.values["delay"] / simulated.timestep
    # A delay of whole steps is not to pick up a rounding error's share of its neighbour.
    nearest = round(steps)
    steps = float(nearest) if abs(steps - nearest) < 1e-9 * max(nearest, 1) else steps
    size = int(steps) + 2
    joints = _delayed(simulated.robot.joints, injection.joint)
    return Action(tuple(hook(Stage.DRIVE, _delay, joint, (steps, size), size) for joint in joints))


def _delayed(joints: int, joint: int | None) -> tuple[int, ...]:
    """The joints of so many whose torque is late: all, or this one. Raises InputError if it is not there."""
    return tuple(range(joints)) if joint is None else (require_joint(DESCRIPTION.name, joint, joints),)


@hook_kernel
def _delay(bus: int, parameters: int, state: int, joint: int) -> None:
    row = bus_row(bus, joint)
    steps, size = vector(parameters, 2)
    buffer = vector(state, int(size))
    now = int(row[STEP])
    if now == 0:
        buffer[:] = row[DRIVE]
    buffer[now % buffer.size] = row[DRIVE]
    whole = int(steps)
    share = steps - whole
    later = buffer[(now - whole) % buffer.size]
    row[DRIVE] = later + share * (buffer[(now - whole - 1) % buffer.size] - later)


def signature(runs: Sequence[Logged], joint: int | None, into: int | None) -> Family:
    """reported(t) = predicted(t + delay): its difference over a delay, so that c is the delay."""
    smallest, rows = DESCRIPTION.parameters[0].lower, _delayed(runs[0].joints, joint)

    def member(shape: Mapping[str, float]) -> Member:
        return Member(
            shape=dict(shape),
            rows=rows,
            columns=by_run(runs, lambda run: _difference(run, rows, shape["difference"])[:, :, None]),
            lower=np.array([shape["difference"] / NEAR if shape["difference"] > GRID[0] else smallest]),
            upper=np.array([shape["difference"] * NEAR]),
        )

    return grid_family(DESCRIPTION.name, joint, member, {"difference": GRID}, _parameters)


def _parameters(member: Member, c: Array, covariance: Array) -> dict[str, Quantity]:
    """The delay. How far it is from the difference that its column was taken over is no less uncertain."""
    std = float(np.hypot(np.sqrt(max(covariance[0, 0], 0.0)), c[0] - member.shape["difference"]))
    return {"delay": Quantity(float(c[0]), std, "s")}


def _difference(run: Logged, joints: Sequence[int], delay: float) -> Array:
    """(predicted(t + delay) - predicted(t)) / delay of r joints, (N, r); the last sample is held."""
    instants, predicted = np.arange(run.samples), run.predicted[:, joints]
    ahead = [np.interp(instants + delay * run.sample_rate, instants, torque) for torque in predicted.T]
    return (np.column_stack(ahead) - predicted) / delay


def write(spec: Any, robot: Robot, injection: Injection) -> tuple[str, ...]:
    """The motors' history buffers."""
    delay = injection.values["delay"]
    step = robot.model.opt.timestep
    for joint in _delayed(robot.joints, injection.joint):
        motor = drive(spec, robot, joint)
        motor.delay = delay
        motor.nsample = int(np.ceil(delay / step)) + 1 if delay > 0 else 0
    if delay == 0:
        return ()
    sentences = ["the history starts empty: fill it with the torque that holds the arm (mj_initCtrlHistory)"]
    if delay < step:
        sentences.append(f"it acts as one time step of {step:g} s, MuJoCo's shortest")
    return tuple(sentences)
