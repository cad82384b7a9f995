"""Logs with the mistakes that people make, at three robots: is each reported in the right words?

A robot with a healthy robot's imperfections is simulated; its model is drawn around it, as CAD and data
sheets are wrong. Each mistake is made in its logs, and the checks must find it, at its joints, and nothing
else that stops.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from identification.excitation.design import DesignOptions, random_excitation
from identification.inverse_dynamics import inverse_dynamics
from identification.parameters import INERTIAL, PER_JOINT
from recordings.checks import Finding, Severity, run_checks
from testbench.background import background
from testbench.log import Recording
from testbench.model_error import ModelError, nominal_model
from testbench.robot import Robot, load_robot
from testbench.simulation import ControllerOptions, SimulationOptions, sample_reference, simulate

Array = NDArray[np.float64]
Runs = Mapping[str, Recording]

RATE = 500.0
SERVO_ARM = """
<mujoco model="servo_arm">
  <compiler angle="radian"/>
  <custom>
    <numeric name="velocity_limit" data="4 4 5 6"/>
    <numeric name="acceleration_limit" data="20 20 30 40"/>
  </custom>
  <worldbody>
    <body name="turret" pos="0 0 .06">
      <inertial pos=".005 0 .02" mass=".25" diaginertia=".0002 .0002 .00015"/>
      <joint name="pan" axis="0 0 1" range="-2.6 2.6" armature=".006" damping=".05" frictionloss=".08"
             actuatorfrcrange="-4 4"/>
      <body name="upper" pos="0 0 .05">
        <inertial pos=".01 0 .12" mass=".45" diaginertia=".0022 .0022 .0003"/>
        <joint name="lift" axis="0 1 0" range="-1.6 1.6" armature=".006" damping=".05" frictionloss=".08"
               actuatorfrcrange="-6 6"/>
        <body name="lower" pos="0 0 .22">
          <inertial pos=".09 .005 0" mass=".3" diaginertia=".0002 .0012 .0012"/>
          <joint name="bend" axis="0 1 0" range="-1.8 1.8" armature=".004" damping=".03" frictionloss=".05"
                 actuatorfrcrange="-4 4"/>
          <body name="hand" pos=".2 0 0">
            <inertial pos=".05 0 .02" mass=".2" diaginertia=".0001 .0003 .0003"/>
            <joint name="tilt" axis="0 1 0" range="-1.8 1.8" armature=".002" damping=".02"
                   frictionloss=".03" actuatorfrcrange="-2 2"/>
          </body>
        </body>
      </body>
    </body>
  </worldbody>
</mujoco>
"""


@dataclass(frozen=True)
class Plant:
    """A robot as it is, the model that its user has, and its healthy runs."""

    truth: Robot
    model: Robot
    runs: Runs


@dataclass(frozen=True)
class Mistake:
    """One mistake that people make.

    make: the runs with it. codes: of the findings that report it; all of them must be there. joints: indices
    that a finding must name, from the start of the chain if positive; None for the whole log. stops: whether
    an answer would be meaningless. by_hand: for the truth's and the model's robot, not the log alone.
    """

    name: str
    make: Callable[[Plant], Runs]
    codes: tuple[str, ...]
    joints: tuple[int, ...] | None = None
    stops: bool = True


def plant(model: Path, seed: int, folder: Path, runs: int = 2) -> Plant:
    """A healthy robot about a model file, simulated along random motions; the same seed gives the same."""
    truth = load_robot(model)
    own = background(truth, seed)
    nominal = nominal_model(truth, ModelError(), seed + 1000, folder / f"{truth.name}_{seed}.xml")
    references = []
    for index in range(runs):
        options = DesignOptions(harmonics=5 + 3 * index, base_frequency=0.1, seed=10 * seed + index)
        motion = random_excitation(nominal.chain, nominal.parameters, nominal.limits, options).trajectory
        references.append(sample_reference(motion, RATE))
    simulated = SimulationOptions(ControllerOptions(rate=RATE), own.sensors, 5e-4, own.effects)
    recordings = simulate(truth, references, simulated, nominal=nominal, seed=seed)
    named = {
        f"run_{index + 1}": replace(each, truth={}, truth_effects=[]) for index, each in enumerate(recordings)
    }
    return Plant(truth, nominal, named)


def judge(made: Plant, mistake: Mistake) -> tuple[bool, tuple[Finding, ...]]:
    """Whether the checks report a mistake in the right words, and all that they find."""
    found = run_checks(made.model, mistake.make(made))
    return is_found(made.model, mistake, found), found


def is_found(robot: Robot, mistake: Mistake, found: tuple[Finding, ...]) -> bool:
    """Whether all codes of the mistake are found, at its joints, and nothing else stops."""
    by_code = {each.code: each for each in found}
    if not all(code in by_code for code in mistake.codes):
        return False
    stopping = {each.code for each in found if each.severity is Severity.STOP}
    if bool(stopping) != mistake.stops or not stopping <= set(mistake.codes):
        return False
    if mistake.joints is None:
        return True
    names = {robot.joint_names[joint] for joint in mistake.joints}
    return set().union(*(by_code[code].joints for code in mistake.codes)) == names


def _each(change: Callable[[Recording], Recording]) -> Callable[[Plant], Runs]:
    return lambda made: {name: change(run) for name, run in made.runs.items()}


def _joint(n: int, joint: int, value: float, rest: float) -> Array:
    out = np.full(n, rest)
    out[joint] = value
    return out


def _torque_times(factors: Callable[[int], Array]) -> Callable[[Plant], Runs]:
    return _each(lambda run: replace(run, torque=run.torque * factors(run.torque.shape[1])))


def _turned(channel: str, *joints: int) -> Callable[[Recording], Recording]:
    def change(run: Recording) -> Recording:
        sign = np.ones(run.position.shape[1])
        sign[list(joints)] = -1
        return replace(_measured(run), **{channel: getattr(run, channel) * sign})

    return change


def _ordered(channels: tuple[str, ...], *cycle: int) -> Callable[[Recording], Recording]:
    """Columns of a cycle of joints passed round."""

    def change(run: Recording) -> Recording:
        order = list(range(run.position.shape[1]))
        for place, follower in zip(cycle, (*cycle[1:], cycle[0]), strict=True):
            order[place] = follower
        return replace(_measured(run), **{each: getattr(run, each)[:, order] for each in channels})

    return change


def _zero(joint: int, degrees: float) -> Callable[[Recording], Recording]:
    def change(run: Recording) -> Recording:
        off = _joint(run.position.shape[1], joint, np.deg2rad(degrees), 0.0)
        return replace(_measured(run), position=run.position + off)

    return change


def _both(*changes: Callable[[Recording], Recording]) -> Callable[[Plant], Runs]:
    def change(run: Recording) -> Recording:
        for each in changes:
            run = each(run)
        return run

    return _each(change)


def _measured(run: Recording) -> Recording:
    """Position and torque alone."""
    return replace(
        run,
        velocity=None,
        torque_command=None,
        reference_position=None,
        reference_velocity=None,
        reference_acceleration=None,
    )


def _without_gravity(made: Plant) -> Runs:
    links = made.truth.parameters.reshape(-1, PER_JOINT).copy()
    links[:, INERTIAL:] = 0

    def change(run: Recording) -> Recording:
        still = np.zeros_like(run.position)
        weight = inverse_dynamics(made.truth.chain, links.ravel(), run.position, still, still)
        return replace(run, torque=run.torque - weight)

    return {name: change(run) for name, run in made.runs.items()}


def _link_side(made: Plant) -> Runs:
    links = made.truth.parameters.reshape(-1, PER_JOINT).copy()
    links[:, INERTIAL:] = 0

    def change(run: Recording) -> Recording:
        speed = np.gradient(run.position, run.time, axis=0)
        size = max(1, round(run.sample_rate / 25))
        kernel = np.hanning(2 * size + 1) / size
        smooth = np.column_stack([np.convolve(each, kernel, "same") for each in speed.T])
        acceleration = np.gradient(smooth, run.time, axis=0)
        torque = inverse_dynamics(made.truth.chain, links.ravel(), run.position, smooth, acceleration)
        noise = 0.01 * np.sqrt(np.mean(torque**2, axis=0))
        rng = np.random.default_rng(0)
        return replace(run, torque=torque + noise * rng.standard_normal(torque.shape))

    return {name: change(run) for name, run in made.runs.items()}


def _velocity(run: Recording) -> Recording:
    speed = np.gradient(run.position, run.time, axis=0)
    return replace(run, torque=speed)


def _zero_at_rest(run: Recording) -> Recording:
    """A rest of a quarter of the run before it, at which the drive reports nothing."""
    count = len(run.time) // 4
    rest = np.repeat(run.position[:1], count, axis=0)
    step = run.time[1] - run.time[0]
    time = np.concatenate([run.time[0] - step * np.arange(count, 0, -1), run.time])
    torque = np.concatenate([np.zeros_like(rest), run.torque])
    return replace(_measured(run), time=time, position=np.concatenate([rest, run.position]), torque=torque)


def _held(run: Recording) -> Recording:
    """Both channels of a bus at a fifth of the rate, on stamps that jitter."""
    kept = np.arange(len(run.time)) // 5 * 5
    jitter = 3e-5 * np.random.default_rng(1).uniform(-1, 1, len(run.time))
    measured = replace(_measured(run), position=run.position[kept], torque=run.torque[kept])
    return replace(measured, time=run.time + jitter)


def _clipped(run: Recording) -> Recording:
    limit = 0.6 * np.abs(run.torque).max(axis=0)
    return replace(_measured(run), torque=np.clip(run.torque, -limit, limit))


def _coarse(run: Recording) -> Recording:
    step = 0.25 * np.sqrt(np.mean(run.torque**2, axis=0))
    return replace(_measured(run), torque=np.round(run.torque / step) * step)


def _command(run: Recording) -> Recording:
    assert run.reference_position is not None
    return replace(run, position=run.reference_position)


def _wrapped(run: Recording) -> Recording:
    position = run.position.copy()
    position[len(position) // 2 :, -1] -= 2 * np.pi
    return replace(_measured(run), position=position)


def _without_motion(run: Recording) -> Recording:
    """The first joint held by its brake, its drive carrying nothing but noise."""
    position, torque = run.position.copy(), run.torque.copy()
    position[:, 0] = position[0, 0]
    torque[:, 0] = 1e-3 * np.abs(torque[:, 0]).max() * np.random.default_rng(2).standard_normal(len(torque))
    return replace(_measured(run), position=position, torque=torque)


def _other_offsets(made: Plant) -> Runs:
    runs = dict(made.runs)
    offset = 0.4 * np.sqrt(np.mean(runs["run_2"].torque ** 2, axis=0))
    runs["run_2"] = replace(runs["run_2"], torque=runs["run_2"].torque + offset)
    return runs


def _factors(*joints: int, factor: float) -> Callable[[int], Array]:
    def of(n: int) -> Array:
        out = np.ones(n)
        out[list(joints)] = factor
        return out

    return of


TORQUE, POSITION = ("torque",), ("position",)
MISTAKES = (
    Mistake("torque of joint 2 backwards", _each(_turned("torque", 1)), ("torque_sign",), (1,)),
    Mistake("position of joint 3 backwards", _each(_turned("position", 2)), ("position_sign",), (2,)),
    Mistake(
        "joint 2 turns the other way",
        _both(_turned("position", 1), _turned("torque", 1)),
        ("axis_turned",),
        (1,),
    ),
    Mistake("zero of joint 3 off by 90°", _each(_zero(2, 90)), ("zero_off",), (2,)),
    Mistake(
        "zero of joint 3 off by 90°, torque of joint 2 backwards",
        _both(_zero(2, 90), _turned("torque", 1)),
        ("zero_off", "torque_sign"),
        (1, 2),
    ),
    Mistake(
        "joint 3 turns the other way from 90°",
        _both(_turned("position", 2), _turned("torque", 2), _zero(2, 90)),
        ("zero_off", "axis_turned"),
        (2,),
    ),
    Mistake("torques of joints 2 and 3 exchanged", _each(_ordered(TORQUE, 1, 2)), ("torque_order",), (1, 2)),
    Mistake(
        "positions of joints 2 and 3 exchanged", _each(_ordered(POSITION, 1, 2)), ("position_order",), (1, 2)
    ),
    Mistake(
        "joints 2 and 3 under each other's names",
        _each(_ordered((*POSITION, *TORQUE), 1, 2)),
        ("joint_order",),
        (1, 2),
    ),
    Mistake(
        "torques of joints 2, 3, 4 passed round",
        _each(_ordered(TORQUE, 1, 2, 3)),
        ("torque_order",),
        (1, 2, 3),
    ),
    Mistake("torque in N·mm", _torque_times(lambda n: np.full(n, 1000.0)), ("torque_scale",)),
    Mistake(
        "motor side of joints 2 to 4, ×4",
        _torque_times(_factors(1, 2, 3, factor=4.0)),
        ("torque_scale",),
        (1, 2, 3),
    ),
    Mistake("×25 at joint 3", _torque_times(_factors(2, factor=25.0)), ("torque_scale",), (2,)),
    Mistake("motor current", _torque_times(lambda n: 1 / np.linspace(8, 25, n)), ("torque_scale",)),
    Mistake(
        "peak for effective current, ×1.41",
        _torque_times(lambda n: np.full(n, 2**0.5)),
        ("torque_scale",),
        None,
        False,
    ),
    Mistake(
        "unsigned torque",
        _each(lambda run: replace(_measured(run), torque=np.abs(run.torque))),
        ("unsigned",),
    ),
    Mistake("velocity in place of torque", _each(_velocity), ("velocity_as_torque",)),
    Mistake("torque after gravity compensation", _without_gravity, ("no_gravity",), None, False),
    Mistake("link-side torque sensors", _link_side, ("link_side",), None, False),
    Mistake("torque clipped", _each(_clipped), ("saturated",), None, False),
    Mistake("torque in coarse steps", _each(_coarse), ("quantised",), None, False),
    Mistake("torque 0 at rest", _each(_zero_at_rest), ("zero_at_rest", "rest"), None, False),
    Mistake("held by a slower bus, stamps that jitter", _each(_held), ("slower_bus",), None, False),
    Mistake("position that is the command", _each(_command), ("position",), None),
    Mistake("position that wraps", _each(_wrapped), ("position",), None),
    Mistake("joint 1 stood still", _each(_without_motion), ("still",), (0,), False),
    Mistake("other offsets in run 2", _other_offsets, ("runs_differ",), None, False),
)
