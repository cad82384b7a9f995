"""Actuator lag: the current loop of one drive follows its command late."""

from collections.abc import Mapping, Sequence
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from ..robot import Robot
from .action import (
    DRIVE,
    STEP,
    TIMESTEP,
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
from .columns import on_one_joint
from .experiment import Experiment
from .mjcf_form import drive
from .signature import Family, Logged, Member, coefficients_as_named

Array = NDArray[np.float64]

DESCRIPTION = EffectDescription(
    name="actuator_lag",
    title="Actuator lag",
    law="time_constant · d(true torque)/dt + true torque = reported torque; second_order: two such "
    "stages of half the time constant",
    reference='Leonhard, "Control of Electrical Drives", 3rd ed., 2001, ch. 7 (closed current loop as a lag)',
    scope=Scope.JOINT,
    parameters=(EffectParameter("time_constant", "s", 0.0, 0.1, (0.0003, 0.02)),),
    laws=("first_order", "second_order"),
    confused_with=("torque_delay", "joint_elasticity"),
    shown_by=(Experiment.HIGH_FREQUENCIES,),
    late=True,
    relinearised=True,
    of_friction=True,
    # Joints of one bus are sampled up to a millisecond apart; a torque may be a mean over its sample.
    healthy=3.0,
    of_sample=0.5,
)
_, SECOND_ORDER = DESCRIPTION.laws
# s: time constants of two stages together, of which a column is made; shorter ones are as good as one stage.
TWO_STAGES = (0.006, 0.012, 0.024)
# And the least and the most that their coefficient may be of it: otherwise they are no two like stages.
LEAST_ALIKE, MOST_ALIKE = 0.7, 1.4
# The damping ratio of two like stages, and of any current loop.
ALIKE, DAMPING_RATIOS = 1.0, (0.5, 1.4)


def action(injection: Injection, simulated: SimulatedRobot) -> Action:
    """One or two first-order stages, exact for a torque command held over a physics step."""
    joint = require_joint(DESCRIPTION.name, injection.joint, simulated.robot.joints)
    stages = 2 if injection.law == SECOND_ORDER else 1
    time_constant = injection.values["time_constant"] / stages
    if time_constant == 0.0:
        return Action()
    return Action((hook(Stage.DRIVE, _lag, joint, (time_constant, stages), 2),))


@hook_kernel
def _lag(bus: int, parameters: int, state: int, joint: int) -> None:
    row = bus_row(bus, joint)
    time_constant, stages = vector(parameters, 2)
    torque = vector(state, 2)
    if row[STEP] == 0:
        torque[:] = row[DRIVE]
    x = row[TIMESTEP] / time_constant
    passed = -np.expm1(-x)
    for stage in range(int(stages)):
        behind = torque[stage] - row[DRIVE]
        torque[stage] -= passed * behind
        # What acts in a step is the stage's mean over it.
        row[DRIVE] += behind * passed / x


def signature(runs: Sequence[Logged], joint: int | None, into: int | None) -> Family:
    """reported = true + time_constant · d(true)/dt, the derivative of the predicted torque.

    Two stages add time_constant²/4 · d²(true)/dt²: a column for a time constant, with that as coefficient.
    Of a loop of second order that rings a little it is more: over the square of its damping ratio.
    """
    joint = require_joint(DESCRIPTION.name, joint, runs[0].joints)
    parameter = DESCRIPTION.parameters[0]
    lower, upper = np.array([parameter.lower]), np.array([parameter.upper])

    def two_stages(shape: Mapping[str, float]) -> Member:
        def columns(run: Logged) -> Array:
            rate = run.predicted_rate(joint)
            of_rate = np.gradient(rate, 1 / run.sample_rate, edge_order=2)
            return (rate + shape["of_stages"] / (2 * shape["damping_ratio"]) ** 2 * of_rate)[:, None]

        least, most = (np.array([alike * shape["of_stages"]]) for alike in (LEAST_ALIKE, MOST_ALIKE))
        return Member(dict(shape), (joint,), on_one_joint(runs, columns), least, most, SECOND_ORDER)

    rate = on_one_joint(runs, lambda run: run.predicted_rate(joint)[:, None])
    one_stage = Member({}, (joint,), rate, lower, upper)
    return Family(
        effect=DESCRIPTION.name,
        joint=joint,
        members=(
            one_stage,
            *(two_stages({"of_stages": each, "damping_ratio": ALIKE}) for each in TWO_STAGES),
        ),
        parameters=coefficients_as_named(DESCRIPTION, ("time_constant",)),
        refine={"of_stages": (TWO_STAGES[0], 2 * TWO_STAGES[-1]), "damping_ratio": DAMPING_RATIOS},
        member=two_stages,
    )


def write(spec: Any, robot: Robot, injection: Injection) -> tuple[str, ...]:
    """The motor's activation as an exact first-order filter."""
    motor = drive(spec, robot, require_joint(DESCRIPTION.name, injection.joint, robot.joints))
    if injection.values["time_constant"] == 0:
        return ()
    motor.dyntype = mujoco.mjtDyn.mjDYN_FILTEREXACT
    motor.dynprm[0] = injection.values["time_constant"]
    sentences = ["the activation starts at zero: set it to the torque that holds the arm"]
    if injection.law == SECOND_ORDER:
        sentences.append("a motor has one activation: one stage of the whole time constant stands for both")
    return tuple(sentences)
