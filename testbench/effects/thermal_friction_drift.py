"""Thermal friction drift: viscous friction falls while its own heat warms the lubricant."""

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from identification.kinematics import kernel
from identification.parameters import COULOMB as COULOMB_PARAMETER
from identification.parameters import VISCOUS as VISCOUS_PARAMETER

from ..robot import Robot
from .action import (
    FRICTION,
    TIMESTEP,
    VELOCITY,
    VISCOUS,
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
from .columns import ColumnsByRun
from .experiment import Experiment
from .fitted_effect import FittedEffect, times
from .signature import Family, Logged, Member, Quantity, coefficients_as_named

Array = NDArray[np.float64]

DESCRIPTION = EffectDescription(
    name="thermal_friction_drift",
    title="Thermal friction drift",
    law="viscous friction·(1 - drop·w), dw/dt = (P / power - w) / time_constant with the friction power P, "
    "w = 0 at the start. two_node: half of w belongs to a housing 5 times slower, and viscosity falls as "
    "(1 - drop)^w. A diagnosis reports the drop at the mean power of its runs",
    reference='Simoni, Beschi, Legnani & Visioli, "Friction modeling with temperature effects for industrial '
    'robot manipulators", IROS 2015; Bittencourt & Axelsson, IEEE/ASME T-MECH 19(5), 2014',
    scope=Scope.JOINT,
    parameters=(
        EffectParameter("drop", "-", 0.0, 0.95, (0.2, 0.6)),
        EffectParameter("time_constant", "s", 0.1, 1e6, (60.0, 10.0)),
        EffectParameter("power", "W", 1e-9, np.inf, (1.0, 1.0), "friction_power"),
    ),
    laws=("one_node", "two_node"),
    confused_with=("nonlinear_viscous_friction",),
    shown_by=(Experiment.WARM_UP,),
    relinearised=True,
    of_friction=True,
    # Any joint loses a tenth of its viscous friction as it warms.
    healthy=0.5,
)

# Viscosity cannot fall below nothing, however hot.
HIGHEST_DROP = 0.95
HOUSING_SHARE, HOUSING_SLOWNESS = 0.5, 5.0
# Of warm joints, which make less heat.
LIKELY_DROP = 0.4
# Of a friction that the runs' warmth has been averaged into.
LARGEST_COEFFICIENT = 4.0
# The friction at a run's end and the next one's start determine a time constant well; one run alone hardly.
CLOSE, FAR, SHORTEST = (5.0, 10.0, 20.0, 40.0, 80.0, 160.0, 320.0), (5.0, 20.0, 80.0), 2.0
# s: no gear warms within less.
FASTEST = 3.5
# s: what warms for far longer than the runs last has any drop; it is sized as if with this time constant.
SLOWEST = 80.0


def action(injection: Injection, simulated: SimulatedRobot) -> Action:
    """Viscous friction scaled by one or two heat states."""
    joint = require_joint(DESCRIPTION.name, injection.joint, simulated.robot.joints)
    values = [injection.values[name] for name in ("drop", "time_constant", "power")]
    return Action(
        (hook(Stage.FRICTION_LEVEL, _warm, joint, [*values, injection.law == "two_node"], state=2),)
    )


@hook_kernel
def _warm(bus: int, parameters: int, state: int, joint: int) -> None:
    row, value, warmth = bus_row(bus, joint), vector(parameters, 4), vector(state, 2)
    heat = abs(row[FRICTION] * row[VELOCITY]) / value[2]
    share = row[TIMESTEP] / value[1]
    warmth[0] += share * (heat - warmth[0])
    warmth[1] += share / HOUSING_SLOWNESS * (heat - warmth[1])
    if value[3] > 0.0:
        mean = (1.0 - HOUSING_SHARE) * warmth[0] + HOUSING_SHARE * warmth[1]
        row[VISCOUS] *= (1.0 - value[0]) ** mean
    else:
        row[VISCOUS] *= 1.0 - min(value[0] * warmth[0], HIGHEST_DROP)


def signature(runs: Sequence[Logged], joint: int | None, into: int | None) -> Family:
    """-fv·w·v and -fc·w·sgn v with the warmth w that the model's friction power makes.

    Shapes ``power``: the mean of these runs, W, of which w = 1 is made; ``carried``: whether a run starts as
    warm as the one before it has ended, or cold; ``paused``: whether the joint was at rest between runs whose
    times follow each other, or went on working; ``even``: whether it warms by the clock, whatever it does.
    Until fv is that of the cold joint the coefficients are too large; where the runs' warmth leaves hardly
    any of it, the model's stands in.
    """
    joint = require_joint(DESCRIPTION.name, joint, runs[0].joints)
    # Of friction that a joint has none of, nothing falls.
    upper = np.where(np.max([_cold(run, joint) for run in runs], axis=0) > 0, LARGEST_COEFFICIENT, 0.0)
    heat = np.concatenate([_heat(run, joint) for run in runs])
    mean = max(float(np.mean(heat)), DESCRIPTION.parameters[-1].lower)
    turns, pauses = _turns(runs)

    def warm(run: Logged, shape: Mapping[str, float], start: float) -> Array:
        if shape["even"]:
            all_of_it, part = np.ones(run.samples), np.zeros(run.samples)
        else:
            power, speed = _heat(run, joint), run.dq[:, joint]
            part = np.minimum(_cold(run, joint)[0] * speed**2, power) / shape["power"]
            all_of_it = power / shape["power"]
        return warmth(all_of_it, part, 1 / (run.sample_rate * shape["time_constant"]), start)

    def member(shape: Mapping[str, float]) -> Member:
        starts, between = [0.0] * len(runs), 0.0 if shape["paused"] else 1.0
        if shape["carried"]:
            end = 0.0
            for turn, pause in zip(turns, pauses, strict=True):
                kept = float(np.exp(-pause / shape["time_constant"]))
                starts[turn] = between + (end - between) * kept
                end = float(warm(runs[turn], shape, starts[turn])[-1])

        def columns(index: int) -> Array:
            run = runs[index]
            viscous, coulomb = _cold(run, joint)
            falls = np.column_stack([viscous * run.dq[:, joint], coulomb * run.direction[:, joint]])
            return (-warm(run, shape, starts[index])[:, None] * falls)[:, None, :]

        return Member(dict(shape), (joint,), ColumnsByRun(columns, len(runs)), np.zeros(2), upper)

    # One run alone carries nothing, and without a pause it makes no difference what the joint did in it.
    starts = [(0.0, 1.0)]
    if len(runs) > 1:
        starts += [(1.0, 1.0), (1.0, 0.0)] if any(pauses) else [(1.0, 1.0)]
    shapes = [
        {"time_constant": t, "carried": carried, "paused": paused, "even": even, "power": mean}
        for carried, paused in starts
        for even in (0.0, 1.0)
        for t in (CLOSE if carried else FAR)
    ]
    return Family(
        effect=DESCRIPTION.name,
        joint=joint,
        members=tuple(member(shape) for shape in shapes),
        parameters=_parameters,
        refine={"time_constant": (SHORTEST, max(CLOSE))},
        member=member,
    )


def _turns(runs: Sequence[Logged]) -> tuple[list[int], list[float]]:
    """The runs in their order, and the seconds before each since the one before it.

    By their times where one clock ran through all of them; else as given, without pauses.
    """
    turns = sorted(range(len(runs)), key=lambda run: float(runs[run].time[0]))
    pauses = [float(runs[run].time[0] - runs[before].time[-1]) for before, run in pairwise(turns)]
    if min(pauses, default=0.0) > 0:
        return turns, [0.0, *pauses]
    return list(range(len(runs))), [0.0] * len(runs)


def _heat(run: Logged, joint: int) -> Array:
    """Power that friction has by the model, (N,) W."""
    return np.maximum(run.friction_at(joint) * run.dq[:, joint], 0.0)


def _cold(run: Logged, joint: int) -> Array:
    """Viscous and Coulomb friction (2,) that warmth takes its share of."""
    nominal = run.nominal.reshape(run.chain.links, -1)[: run.joints]
    table = np.maximum(run.table, nominal / LARGEST_COEFFICIENT)
    return np.maximum(table[joint, [VISCOUS_PARAMETER, COULOMB_PARAMETER]], 0.0)


def _parameters(member: Member, c: Array, covariance: Array) -> dict[str, Quantity]:
    named = coefficients_as_named(DESCRIPTION, ("drop", "coulomb_drop"))
    return named(member, np.minimum(c, HIGHEST_DROP), covariance)


def warmth(heat: Array, falling: Array, share: float, start: float) -> Array:
    """The heat state w (N,) along P / power (N,) from start; share: of the time constant in a sample.

    falling: the part of it that viscous friction makes, which falls by LIKELY_DROP w.
    """
    out = np.empty_like(heat)
    _first_order(np.ascontiguousarray(heat), np.ascontiguousarray(falling), share, start, out)
    return out


@kernel
def _first_order(heat: Array, falling: Array, share: float, start: float, out: Array) -> None:
    state = start
    for t in range(heat.size):
        lost = min(LIKELY_DROP * state, HIGHEST_DROP)
        state += share * (heat[t] - lost * falling[t] - state)
        out[t] = state


def size(fitted: FittedEffect) -> float:
    """Its drop, as far as the runs reach it, as a multiple of a mild one."""
    constant = fitted.member.shape["time_constant"]
    reached = float(np.expm1(-fitted.seconds / constant) / np.expm1(-fitted.seconds / SLOWEST))
    return times(fitted.value("drop") * min(reached, 1.0), fitted.mild("drop"))


def is_excessive(fitted: FittedEffect, share: float) -> bool:
    """Whether it warms faster than any gear."""
    return fitted.member.shape["time_constant"] < FASTEST


def write(spec: Any, robot: Robot, injection: Injection) -> tuple[str, ...]:
    """MuJoCo's thermal model is that of a winding's resistance."""
    return ("MJCF has no friction that changes with temperature; the joint keeps its cold damping",)
