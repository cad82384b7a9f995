"""Joints that bristles hold: there, what a joint has passed predicts its friction at rest, too.

Near rest no sample counts, since Coulomb friction there is whatever holds the joint. Bristles have no such
freedom: what they bear follows from what the joint has moved since they last slid. An arm that stands
between its moves shows them there and hardly anywhere else. Where they predict the friction at rest,
samples near rest count as well.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from identification.parameters import COULOMB, PER_JOINT
from testbench.effects.columns import ColumnsByRun
from testbench.effects.signature import Member
from testbench.robot import Robot

from ..data.preparation import Prepared
from ..fit.normal_equations import left_everywhere, standard_values
from ..fit.score import Stage
from ..model.candidates import Candidate, candidate, without_law
from ..model.effect_sizes import BRISTLES, times_healthy

Array = NDArray[np.float64]

# Share of the squared residual near rest that bristles must explain; and shares that they may leave of what
# the stiffest bristles leave, and friction that only keeps its direction.
EXPLAINED, OF_STIFFEST, OF_KEPT = 0.8, 0.2, 0.5
# In so many rests and turns at least, and by so much of the joint's torque over all of the runs.
FEWEST_RESTS, SMALLEST = 6, 0.01
# The share of the joint's Coulomb friction that they bear.
LEVEL = 0.5, 1.5
# And so many times as soft as a healthy joint's, which near rest are seen as well.
SOFTER = 1.5
# How far apart the displacements are that are tried first, and how precisely the best is found from there.
APART, TOLERANCE = 2.5, 0.05
# Where this share of the other joints, three at least, gives way near rest at least this share as far, it is
# how this robot's joints are.
OF_OTHERS, ALIKE, FEWEST_ALIKE = 0.5, 0.5, 3
# From this share of their level on friction has the direction that they slide in.
SLIDES = 0.9


def held_by_bristles(robot: Robot, stage: Stage, proposals: Sequence[Candidate]) -> frozenset[int]:
    """The joints whose friction near rest is that of bristles softer than a healthy joint's.

    robot: that sizes are relative to. proposals: bristles at any joint among them.
    """
    prepared = stage.prepared
    if prepared.coulomb_lead > 0:
        return frozenset()
    values, whole = stage.fitted.values, slice(None)
    left = [left_everywhere(stage.hypothesis, run, whole, values) for run in range(len(prepared.runs))]
    soft = set(np.flatnonzero(prepared.coulomb_smoothing).tolist())
    bristles = [
        [c for c in proposals if c.family.effect == BRISTLES and c.family.joint == joint]
        for joint in range(prepared.joints)
    ]

    def seen(joint: int) -> _Bristles:
        if joint in soft or not bristles[joint]:
            return _Bristles()
        return _bristles(robot, stage, joint, bristles[joint], [run[:, joint] for run in left])

    # Beside others of its joint a law is only their rest.
    known = {each.family.joint for each in stage.hypothesis.accepted} | prepared.held
    of_joint = {joint: seen(joint) for joint in range(prepared.joints) if joint not in known}
    found = {joint: each.times for joint, each in of_joint.items() if each.foretells}
    if not found:
        return frozenset()
    others = np.array([(of_joint.get(joint) or seen(joint)).times for joint in range(prepared.joints)])
    others[list(prepared.held)] = np.inf
    many = max(OF_OTHERS * (prepared.joints - 1), FEWEST_ALIKE)
    return frozenset(
        joint
        for joint, times in found.items()
        if np.count_nonzero(np.delete(others, joint) >= ALIKE * times) < many
    )


@dataclass(frozen=True)
class _Bristles:
    """Bristles near rest: how many times as soft as a healthy joint's.

    foretells: whether that is enough, and nothing simpler does as well.
    """

    times: float = 0.0
    foretells: bool = False


def _bristles(
    robot: Robot, stage: Stage, joint: int, bristles: Sequence[Candidate], residual: Sequence[Array]
) -> _Bristles:
    """The bristles that predict the joint's friction at rest; none where none do.

    residual: a run, (M,) N·m that the hypothesis leaves of the joint's torque, near rest too.
    """
    prepared = stage.prepared
    near = [run.whole[:, joint] & ~run.used[:, joint] for run in prepared.runs]
    rests = sum(np.count_nonzero(np.diff(each.astype(int), prepend=0) == 1) for each in near)
    coulomb = float(standard_values(prepared, stage.fitted.values)[PER_JOINT * joint + COULOMB])
    if rests < FEWEST_RESTS or coulomb <= 0:
        return _Bristles()
    left = np.concatenate([each[rows] for each, rows in zip(residual, near, strict=True)])

    def beside(friction: Candidate) -> tuple[float, float]:
        """Squared residual near rest with this friction fitted, and its fitted level, N·m, within bounds."""
        each = zip(friction.filtered, near, strict=True)
        column = np.concatenate([filtered[rows, 0, 0] for filtered, rows in each])
        size = max(float(column @ column), np.finfo(float).tiny)
        level = float(np.clip(column @ left / size, *(coulomb * np.array(LEVEL))))
        return float(np.sum((left - level * column) ** 2)), level

    torque_rms = stage.ground.torque_rms
    whole, counted = float(left @ left), sum(np.count_nonzero(run.whole[:, joint]) for run in prepared.runs)
    most = min((1 - EXPLAINED) * whole, whole - counted * (SMALLEST * torque_rms[joint]) ** 2)
    of_each = [beside(each)[0] for each in bristles]
    if min(of_each) > most:
        return _Bristles()
    likeliest = bristles[int(np.argmin(of_each))]
    family, make = likeliest.family, likeliest.family.member
    assert make is not None

    def of_displacement(displacement: float) -> Candidate:
        shape = {**likeliest.member.shape, "displacement": displacement}
        return candidate(prepared, family, make(shape))

    middle = np.log(likeliest.member.shape["displacement"])
    found = minimize_scalar(
        lambda logarithm: beside(of_displacement(float(np.exp(logarithm))))[0],
        bounds=(middle - np.log(APART), middle + np.log(APART)),
        method="bounded",
        options={"xatol": TOLERANCE},
    )
    bristle = of_displacement(float(np.exp(found.x)))
    best, level = beside(bristle)
    times = times_healthy(robot, torque_rms, bristle, np.array([level]))
    if times < SOFTER:
        return _Bristles(times)
    keeping = [
        beside(_keeping(prepared, joint, each.member))[0] for each in bristles if each.member.law is None
    ]
    stiffest = candidate(prepared, family, make({"displacement": family.refine["displacement"][0]}))
    return _Bristles(times, best < min(OF_STIFFEST * beside(stiffest)[0], OF_KEPT * min(keeping)))


def _keeping(prepared: Prepared, joint: int, bristle: Member) -> Candidate:
    """Candidate: change of unit Coulomb friction that keeps its sign until bristles slide the other way."""

    def columns(run: int) -> Array:
        sign = np.sign(prepared.runs[run].logged.dq[:, joint])
        borne = bristle.columns[run][:, 0, 0] + sign
        last = np.maximum.accumulate(np.where(np.abs(borne) >= SLIDES, np.arange(len(borne)), 0))
        kept = np.where(np.abs(borne[last]) >= SLIDES, np.sign(borne[last]), 0.0)
        return (kept - sign)[:, None, None]

    made = ColumnsByRun(columns, len(prepared.runs))
    return without_law(prepared, "friction that keeps its direction", joint, made, np.zeros(1), {})
