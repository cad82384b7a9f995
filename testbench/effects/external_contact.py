"""External contact: something pushes a link for a while."""

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from ..robot import Robot
from .action import (
    LINK_POSITION,
    LINK_TORQUE,
    TIME,
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
from .columns import Window, WindowedColumns
from .experiment import Experiment
from .link_force import LINK, force_in_link, independent, link_table, push_point, push_torques
from .logged import body_in_link
from .mjcf_form import drive, joint_element
from .push import (
    ABRUPT,
    BELL,
    JOINT_TORQUE,
    LINK_FORCE,
    RAMP,
    SMOOTHING,
    TIMES,
    WORLD_FORCE,
    WORLD_FORCE_AT_END,
    push_torques_of,
    widened,
    windows,
)
from .signature import Family, Logged, Member, Quantity

Array = NDArray[np.float64]

DESCRIPTION = EffectDescription(
    name="external_contact",
    title="External contact",
    law="torque = inverse dynamics - J'(q) F(t): a force at the end of a joint's link, of that torque "
    "about the joint, from start for a duration; link_force: F turns with the link; world_force: F keeps "
    "its direction in space; joint_torque: on the joint alone",
    reference='Haddadin, De Luca & Albu-Schäffer, "Robot collisions: a survey on detection, isolation, '
    'and identification", IEEE Trans. Robotics 33(6), 2017',
    scope=Scope.JOINT,
    parameters=(
        EffectParameter("torque", "N·m", -np.inf, np.inf, (0.05, 0.3), "torque_limit"),
        EffectParameter("start", "s", 0.0, np.inf, (2.0, 6.0)),
        EffectParameter("duration", "s", 0.0, np.inf, (0.2, 1.0)),
    ),
    laws=("link_force", "world_force", "joint_torque"),
    confused_with=("torque_saturation", "cable_spring"),
    shown_by=(Experiment.ONCE_MORE,),
    at_times=True,
    is_event=True,
    # A push is one, however weak.
    healthy=0.0,
)
# Parameters of the hook before its table of links, and its state before q and torque: whether a direction
# is kept, and the force in base axes.
HEAD, STATE = 13, 4
# Of the strongest joint's drive, what any other's withstands at least.
SMALLEST = 1e-3


def action(injection: Injection, simulated: SimulatedRobot) -> Action:
    """J' F at the joints up to the link, along the simulated motion; the drive sees it as load."""
    chain = simulated.robot.chain
    joint = require_joint(DESCRIPTION.name, injection.joint, chain.joints)
    values = injection.values
    point, direction = push_point(chain, joint)
    lever = 1.0 if chain.is_slide[joint] else float(np.linalg.norm(point))
    law = DESCRIPTION.laws.index(injection.law)
    ramp = min(RAMP, 0.25 * values["duration"])
    head = [chain.links, law, values["start"], values["duration"], ramp]
    head += [*point, *(direction * values["torque"] / lever), values["torque"], chain.in_tree[joint]]
    parameters = np.concatenate([head, link_table(chain).ravel()])
    return Action((hook(Stage.TORQUE, _push, joint, parameters, STATE + 2 * (joint + 1)),))


@hook_kernel
def _push(bus: int, parameters: int, state: int, joint: int) -> None:
    row = bus_row(bus, joint)
    n = int(vector(parameters, 1)[0])
    values = vector(parameters, HEAD + LINK * n)
    since = row[TIME] - values[2]
    left = values[3] - since
    if since < 0.0 or left <= 0.0:
        return
    size, nearest = 1.0, min(since, left)
    if nearest < values[4]:
        size = 0.5 - 0.5 * np.cos(np.pi * nearest / values[4])
    if values[1] == JOINT_TORQUE:
        row[LINK_TORQUE] += size * values[11]
        return
    links, link = values[HEAD:].reshape((n, LINK)), int(values[12])
    memory = vector(state, STATE + 2 * (joint + 1))
    q, torque = memory[STATE : STATE + joint + 1], memory[STATE + joint + 1 :]
    for i in range(joint + 1):
        q[i] = bus_row(bus, i)[LINK_POSITION]
    fx, fy, fz = values[8], values[9], values[10]
    if values[1] == WORLD_FORCE and memory[0] == 1.0:
        fx, fy, fz = force_in_link(links, q, link, memory[1], memory[2], memory[3])
    in_base = push_torques(links, q, link, values[5:8], fx, fy, fz, torque)
    if memory[0] == 0.0:
        memory[0] = 1.0
        memory[1], memory[2], memory[3] = in_base
    for i in range(joint + 1):
        bus_row(bus, i)[LINK_TORQUE] += size * torque[i]


def signature(runs: Sequence[Logged], joint: int | None, into: int | None) -> Family:
    """Forces on the link in windows where the residual stands out: a profile of time, and one that leans.

    No window, no member.
    """
    joint = require_joint(DESCRIPTION.name, joint, runs[0].joints)
    return pushes(runs, joint, [windows(run, runs[0].chain.path(joint)) for run in runs])


def pushes(runs: Sequence[Logged], joint: int, when: Sequence[list[tuple[int, int]]]) -> Family:
    """Forces on the link of a joint in the given windows, a run, as ``windows`` finds them.

    The members differ in the force (``kind``: with a couple, turning with the link or fixed in space; a
    torque of the joint alone; at the end of the link, fixed in space) and in the profile (``stretch``). No
    window, no member; but one of ``recurring_push`` can be made.
    """
    withstands = withstood(runs)
    members = tuple(
        _member(runs, joint, when, kind, stretch, withstands)
        for kind in (LINK_FORCE, WORLD_FORCE, JOINT_TORQUE, WORLD_FORCE_AT_END)
        for stretch in (ABRUPT, BELL)
    )
    return Family(
        effect=DESCRIPTION.name,
        joint=joint,
        members=members if any(when) else (),
        parameters=partial(_parameters, runs, joint, when),
        member=partial(recurring_push, runs, joint),
        made_with=TIMES,
    )


def recurring_push(runs: Sequence[Logged], joint: int, shape: Mapping[str, float]) -> Member:
    """A push that is alike and at the same time in every run: ``first`` to ``last``, s, between half heights.

    ``kind`` and ``stretch`` as of push.py.
    """
    kind, stretch = int(shape["kind"]), shape["stretch"]
    rows, count = push_torques_of(runs[0], joint, slice(0, 1), kind, stretch).shape[1:]
    found: list[tuple[Window, ...]] = []
    for run in runs:
        first, last = (round(shape[end] * run.sample_rate) for end in TIMES)
        part = widened(run, (first, last), stretch)
        found.append(())
        if part.start < part.stop:
            found[-1] = (Window(part.start, 0, -push_torques_of(run, joint, part, kind, stretch)),)
    columns = WindowedColumns(tuple(found), tuple(run.samples for run in runs), (rows, count))
    unbounded = np.full(count, np.inf)
    return Member(dict(shape), _rows(runs[0], joint, kind), columns, -unbounded, unbounded)


def _member(
    runs: Sequence[Logged],
    joint: int,
    when: Sequence[list[tuple[int, int]]],
    kind: int,
    stretch: float,
    withstands: Array,
) -> Member:
    """A coefficient for every window, component of the load and profile of time, less what does not show.

    withstands: of ``withstood``.
    """
    rows = _rows(runs[0], joint, kind)
    scale = withstands[list(rows)] / withstands.max()
    found, count = [], 0
    for run, own in zip(runs, when, strict=True):
        parts = []
        for window in own:
            part = widened(run, window, stretch)
            torque = push_torques_of(run, joint, part, kind, stretch)
            parts.append(Window(part.start, count, -torque @ independent(torque, scale)))
            count += parts[-1].values.shape[2]
        found.append(tuple(parts))
    columns = WindowedColumns(tuple(found), tuple(run.samples for run in runs), (len(rows), count))
    unbounded = np.full(count, np.inf)
    return Member({"kind": float(kind), "stretch": stretch}, rows, columns, -unbounded, unbounded)


def withstood(runs: Sequence[Logged]) -> Array:
    """What each joint's drive can give, (n,) N·m; the largest torque of these runs where it has no limit."""
    limit, peak = runs[0].limits.torque, np.max([np.abs(run.tau).max(axis=0) for run in runs], axis=0)
    known = np.where(np.isfinite(limit), limit, peak)
    # A joint that never had any torque.
    return np.maximum(known, max(SMALLEST * float(known.max()), np.finfo(float).tiny))


def _rows(run: Logged, joint: int, kind: int) -> tuple[int, ...]:
    return (joint,) if kind == JOINT_TORQUE else tuple(run.chain.path(joint))


def _parameters(
    runs: Sequence[Logged],
    joint: int,
    when: Sequence[list[tuple[int, int]]],
    member: Member,
    c: Array,
    covariance: Array,
) -> dict[str, Quantity]:
    """The contact's largest torque about the joint, and when it was: start and end of each window."""
    last_row = len(member.rows) - 1
    best, std, intervals = 0.0, 0.0, []
    for run, columns, own in zip(runs, member.columns, when, strict=True):
        torque = -columns[:, last_row] @ c
        peak = int(np.argmax(np.abs(torque)))
        if abs(torque[peak]) > abs(best):
            row = columns[peak, last_row]
            best = float(torque[peak])
            std = float(np.sqrt(max(float(row @ covariance[: len(c), : len(c)] @ row), 0.0)))
        for first, last in own:
            intervals += [float(run.time[first]), float(run.time[last - 1])]
    resolution = 1 / runs[0].sample_rate
    return {
        "torque": Quantity(best, std, "N·m"),
        "intervals": Quantity(tuple(intervals), (SMOOTHING + resolution,) * len(intervals), "s"),
    }


def write(spec: Any, robot: Robot, injection: Injection) -> tuple[str, ...]:
    """A force actuator on the link, with the contact's force at unit control."""
    joint = require_joint(DESCRIPTION.name, injection.joint, robot.joints)
    start, end = injection.values["start"], injection.values["start"] + injection.values["duration"]
    when = f"the model has no clock: let its control be 1 from {start:g} to {end:g} s, with smooth flanks"
    element = joint_element(spec, robot, joint)
    # First, so that nobody takes the contact for the joint's motor.
    drive(spec, robot, joint)
    name = f"contact_{joint + 1}"
    actuator = spec.add_actuator(name=name)
    actuator.set_to_motor()
    torque = injection.values["torque"]
    if injection.law == "joint_torque":
        actuator.trntype, actuator.target = mujoco.mjtTrn.mjTRN_JOINT, element.name
        actuator.gear = [torque, 0, 0, 0, 0, 0]
        return (f"actuator {name} is the contact, but {when}",)
    point, direction = push_point(robot.chain, joint)
    lever = 1.0 if robot.chain.is_slide[joint] else float(np.linalg.norm(point))
    rotation, origin = body_in_link(robot, joint)
    site = element.parent.add_site(name=name, pos=rotation.T @ (point - origin))
    force = rotation.T @ direction * torque / lever
    actuator.trntype, actuator.target = mujoco.mjtTrn.mjTRN_SITE, site.name
    actuator.gear = [*force, 0, 0, 0]
    if injection.law == "world_force":
        return (f"actuator {name} is the contact with a force that turns with the link, and {when}",)
    return (f"actuator {name} is the contact, but {when}",)
