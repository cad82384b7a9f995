"""External contact: something pushes a link for a while."""

from collections.abc import Sequence
from functools import partial
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from identification.chain import Chain
from identification.kinematics import cross, into_link, into_parent, kernel, link_rotation

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
from .logged import body_in_link
from .mjcf_form import drive, joint_element
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
)
LINK_FORCE, WORLD_FORCE, JOINT_TORQUE = range(3)
# Parameters of the hook before its table of links, columns of that table, and its state before q and
# torque: whether a direction is kept, and the force in base axes.
HEAD, LINK, STATE = 12, 13, 4

# The force rises and falls over this time, s, or a quarter of the duration.
RAMP = 0.1
# Where a link ends, if nothing follows it, m.
SHORTEST_ARM = 0.1

# A contact's window: smoothed over so long, s, the residual is so many times its usual size, which is
# taken to be no less than this share of its largest.
SMOOTHING, THRESHOLD, QUIETEST = 0.1, 4.0, 0.05
SHORTEST, GAP = 0.05, 0.15
# What covers more of a run than this is no event; the strongest so many windows a run are taken.
LARGEST_SHARE, WINDOWS = 0.35, 3
# How much longer than between its half heights a contact is: one with flanks, and a bell (half a sine).
ABRUPT, BELL = 1.0, 1.5
PROFILES = 2


def push_point(chain: Chain, joint: int) -> tuple[Array, Array]:
    """Where the link is pushed, (3,) m in its frame, and the direction (3,) of a positive torque.

    It is where the next joint sits, or a tenth of a metre out; its distance from the axis is the lever.
    """
    end = np.zeros(3)
    if joint + 1 < chain.joints:
        end[:2] = chain.translation[joint + 1, :2]
    if np.linalg.norm(end) < SHORTEST_ARM:
        end = np.array([SHORTEST_ARM, 0.0, 0.0])
    if chain.is_slide[joint]:
        return end, np.array([0.0, 0.0, 1.0])
    return end, np.array([-end[1], end[0], 0.0]) / np.linalg.norm(end)


def action(injection: Injection, simulated: SimulatedRobot) -> Action:
    """J' F at the joints up to the link, along the simulated motion; the drive sees it as load."""
    chain = simulated.robot.chain
    joint = require_joint(DESCRIPTION.name, injection.joint, chain.joints)
    values = injection.values
    point, direction = push_point(chain, joint)
    lever = 1.0 if chain.is_slide[joint] else float(np.linalg.norm(point))
    law = DESCRIPTION.laws.index(injection.law)
    ramp = min(RAMP, 0.25 * values["duration"])
    head = [chain.joints, law, values["start"], values["duration"], ramp]
    head += [*point, *(direction * values["torque"] / lever), values["torque"]]
    parameters = np.concatenate([head, _links(chain).ravel()])
    return Action((hook(Stage.TORQUE, _push, joint, parameters, STATE + 2 * chain.joints),))


def _links(chain: Chain) -> Array:
    """(n, 13): whether a joint slides, and its link's translation and rotation at q = 0."""
    flat = chain.rotation.reshape(chain.joints, 9)
    return np.ascontiguousarray(np.column_stack([chain.is_slide, chain.translation, flat]), dtype=np.float64)


@hook_kernel
def _push(bus, parameters, state, joint):  # type: ignore[no-untyped-def]
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
    links = values[HEAD:].reshape((n, LINK))
    memory = vector(state, STATE + 2 * n)
    q, torque = memory[STATE : STATE + n], memory[STATE + n :]
    for i in range(joint + 1):
        q[i] = bus_row(bus, i)[LINK_POSITION]
    fx, fy, fz = values[8], values[9], values[10]
    if values[1] == WORLD_FORCE and memory[0] == 1.0:
        fx, fy, fz = force_in_link(links, q, joint, memory[1], memory[2], memory[3])
    in_base = push_torques(links, q, joint, values[5:8], fx, fy, fz, torque)
    if memory[0] == 0.0:
        memory[0] = 1.0
        memory[1], memory[2], memory[3] = in_base
    for i in range(joint + 1):
        bus_row(bus, i)[LINK_TORQUE] += size * torque[i]


@kernel
def push_torques(links, q, joint, point, fx, fy, fz, torque):  # type: ignore[no-untyped-def]
    """Write J' F of a force at a point (3,), both in a link's frame, to torque; returns F in base axes."""
    rotation = np.empty(9)
    nx, ny, nz = cross(point[0], point[1], point[2], fx, fy, fz)
    for i in range(joint, -1, -1):
        slide = links[i, 0] == 1.0
        torque[i] = fz if slide else nz
        shift = turn_and_shift(links[i], q[i], rotation)
        fx, fy, fz = into_parent(rotation, fx, fy, fz)
        nx, ny, nz = into_parent(rotation, nx, ny, nz)
        ox, oy, oz = links[i, 1] + shift * links[i, 6], links[i, 2] + shift * links[i, 9], links[i, 3]
        cx, cy, cz = cross(ox, oy, oz + shift * links[i, 12], fx, fy, fz)
        nx, ny, nz = nx + cx, ny + cy, nz + cz
    return fx, fy, fz


@kernel
def force_in_link(links, q, joint, fx, fy, fz):  # type: ignore[no-untyped-def]
    """A force in base axes, in a link's."""
    rotation = np.empty(9)
    for i in range(joint + 1):
        turn_and_shift(links[i], q[i], rotation)
        fx, fy, fz = into_link(rotation, fx, fy, fz)
    return fx, fy, fz


@kernel
def turn_and_shift(link, q, rotation):  # type: ignore[no-untyped-def]
    """Write the link's rotation in its parent (9,); returns how far it slides along its axis."""
    slide = link[0] == 1.0
    angle = 0.0 if slide else q
    link_rotation(link[4:].reshape((3, 3)), np.cos(angle), np.sin(angle), rotation)
    return q if slide else 0.0


def signature(runs: Sequence[Logged], joint: int | None, into: int | None) -> Family:
    """Forces on the link in windows where the residual stands out: a profile of time, and one that leans.

    The members differ in the force (``kind``: at the end of the link turning with it, there but fixed in
    space, or a torque of the joint alone) and in the profile (``stretch``). No window, no member.
    """
    joint = require_joint(DESCRIPTION.name, joint, runs[0].joints)
    windows = [_windows(run, joint) for run in runs]
    parameters = partial(_parameters, runs, joint, windows)
    if not any(windows):
        return Family(DESCRIPTION.name, joint, (), parameters)
    members = tuple(
        _member(runs, joint, windows, kind, stretch)
        for kind in (LINK_FORCE, WORLD_FORCE, JOINT_TORQUE)
        for stretch in (ABRUPT, BELL)
    )
    return Family(DESCRIPTION.name, joint, members, parameters)


def _windows(run: Logged, joint: int) -> list[tuple[int, int]]:
    """First and last sample of each window, in time's order: where joints up to this one stand out."""
    width = max(int(SMOOTHING * run.sample_rate), 1)
    smooth = uniform_filter1d(run.residual[:, : joint + 1], width, axis=0)
    size = np.abs(smooth - np.median(smooth, axis=0))
    usual = np.maximum(np.median(size, axis=0) / 0.6745, QUIETEST * size.max(axis=0))
    level = (size / np.maximum(usual, np.finfo(float).tiny)).max(axis=1)
    edges = np.flatnonzero(np.diff(np.r_[0, (level > THRESHOLD).astype(np.int8), 0]))
    found: list[list[int]] = []
    for first, last in zip(edges[::2], edges[1::2], strict=True):
        if found and first - found[-1][1] < GAP * run.sample_rate:
            found[-1][1] = int(last)
        else:
            found.append([int(first), int(last)])
    found = [window for window in found if window[1] - window[0] >= SHORTEST * run.sample_rate]
    if sum(last - first for first, last in found) > LARGEST_SHARE * run.samples:
        return []
    found.sort(key=lambda window: -float(np.sum(level[window[0] : window[1]] ** 2)))
    halved = []
    for first, last in sorted(found[:WINDOWS]):
        inside = level[first:last]
        high = np.flatnonzero(inside > 0.5 * inside.max())
        halved.append((first + int(high[0]), first + int(high[-1]) + 1))
    return halved


def _member(
    runs: Sequence[Logged], joint: int, windows: Sequence[list[tuple[int, int]]], kind: int, stretch: float
) -> Member:
    """A coefficient for every window, component of the force and profile of time."""
    rows = (joint,) if kind == JOINT_TORQUE else tuple(range(joint + 1))
    components = 1 if kind == JOINT_TORQUE else 3
    count = sum(len(own) for own in windows) * components * PROFILES
    columns, index = [], 0
    for run, own in zip(runs, windows, strict=True):
        out = np.zeros((run.samples, len(rows), count))
        for half_first, half_last in own:
            # A flank's half height is in its middle, a bell's a sixth of its length from the end.
            longer = 0.5 * (half_last - half_first) if stretch == BELL else RAMP * run.sample_rate
            more = int(0.5 * longer)
            first, last = max(half_first - more, 0), min(half_last + more, run.samples)
            torque = -_unit_torques(run, joint, first, last, kind)
            profiles = _profiles(last - first, RAMP * run.sample_rate, stretch)
            for component in range(components):
                for profile in profiles:
                    out[first:last, :, index] = profile[:, None] * torque[:, :, component]
                    index += 1
        columns.append(out)
    unbounded = np.full(count, np.inf)
    return Member({"kind": float(kind), "stretch": stretch}, rows, tuple(columns), -unbounded, unbounded)


def _profiles(samples: int, ramp: float, stretch: float) -> Array:
    """A bell or a trapezoid with flanks of ``ramp`` samples, and the same leaning: (PROFILES, samples)."""
    place = (np.arange(samples) + 0.5) / samples
    if stretch == BELL:
        return np.stack([np.sin(np.pi * place), np.sin(2 * np.pi * place)])
    flank = np.minimum(np.minimum(place, 1 - place) * samples / ramp, 1.0)
    trapezoid = 0.5 - 0.5 * np.cos(np.pi * flank)
    return np.stack([trapezoid, trapezoid * (1 - 2 * place)])


def _unit_torques(run: Logged, joint: int, first: int, last: int, kind: int) -> Array:
    """J' of unit forces at the pushed point: (M, joint + 1, 3), or (M, 1, 1) of a unit joint torque."""
    if kind == JOINT_TORQUE:
        return np.ones((last - first, 1, 1))
    out = np.empty((last - first, joint + 1, 3))
    point = push_point(run.chain, joint)[0]
    _fill_unit_torques(_links(run.chain), run.q[first:last], joint, point, kind == WORLD_FORCE, out)
    return out


@kernel
def _fill_unit_torques(links, q, joint, point, in_base, out):  # type: ignore[no-untyped-def]
    torque = np.empty(joint + 1)
    for t in range(q.shape[0]):
        for component in range(3):
            fx, fy, fz = 1.0 * (component == 0), 1.0 * (component == 1), 1.0 * (component == 2)
            if in_base:
                fx, fy, fz = force_in_link(links, q[t], joint, fx, fy, fz)
            push_torques(links, q[t], joint, point, fx, fy, fz, torque)
            for i in range(joint + 1):
                out[t, i, component] = torque[i]


def _parameters(
    runs: Sequence[Logged],
    joint: int,
    windows: Sequence[list[tuple[int, int]]],
    member: Member,
    c: Array,
    covariance: Array,
) -> dict[str, Quantity]:
    """The contact's largest torque about the joint, and when it was: start and end of each window."""
    last_row = len(member.rows) - 1
    best, std, intervals = 0.0, 0.0, []
    for run, columns, own in zip(runs, member.columns, windows, strict=True):
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
