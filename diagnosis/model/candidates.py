"""Candidate effects on these runs: every family's columns, filtered like the torque."""

import os
from collections import defaultdict
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np
from numpy.typing import NDArray

from testbench.effects import effect, effects
from testbench.effects.base import EffectDescription, Scope
from testbench.effects.columns import ColumnsByInstant, ColumnsByRun, WindowedColumns, over_all_joints
from testbench.effects.signature import Family, Member, Quantity, places

from ..data.run import Prepared

Array = NDArray[np.float64]

# An effect's name, its joint and the second joint of a pair.
Place = tuple[str, int | None, int | None]
# Effects with a search of their own: a push, which happens in one run and says nothing of another; a limit,
# beyond which the torque that is regressed on would stand on both sides; a delay, and a zero, which are found
# at any size.
PUSH, SATURATION = "external_contact", "torque_saturation"
DELAY, ZERO = "torque_delay", "encoder_offset"
# Bytes of all joints' samples at the full rate: families that are made at the same time share so many.
MOST_AT_ONCE = 1 << 26
# What the effect of a free function of the motion is called before its regime.
FREE = "unknown: "
# Of what is under no law of the catalogue.
NO_EFFECT = EffectDescription(name="", title="", law="", reference="", scope=Scope.JOINT, parameters=())


@dataclass(frozen=True)
class Candidate:
    """One member of a family on these runs.

    family: the effect and its place. member: which shape. filtered: a run, (M, r, k) at the member's rows.
    joints: n of the robot. samples: of all these runs together, at the full rate. sample_time: s, the longest
    of them. position_step: (n,) rad (m), that their encoders count in, the coarsest. is_carried: whether the
    load of these runs has its torque already.
    """

    family: Family
    member: Member
    filtered: tuple[Array, ...]
    joints: int
    samples: int
    sample_time: float
    position_step: Array
    is_carried: bool = False

    @cached_property
    def columns(self) -> tuple[Array, ...]:
        """A run each, (M, n, k): filtered, and zero where the effect does not reach."""
        return tuple(over_all_joints(run, self.member.rows, self.joints) for run in self.filtered)

    @property
    def description(self) -> EffectDescription:
        """The description of its effect, an empty one where it is under no law of the catalogue."""
        known = effects().get(self.family.effect)
        return NO_EFFECT if known is None else known.DESCRIPTION

    @property
    def count(self) -> int:
        """Number of coefficients, k."""
        return self.member.count

    @property
    def precision(self) -> Array:
        """Prior precision (k,) of the coefficients; 0 where they may have any size."""
        widths = self.member.widths
        return np.zeros(self.count) if widths is None else np.asarray(widths**-2.0)

    @property
    def shapes(self) -> int:
        """Number of shapes of its law that are tried."""
        of_its_law = sum(member.law == self.member.law for member in self.family.members)
        return max(of_its_law, self.family.picked_from, 1)

    @property
    def shows(self) -> bool:
        """Whether anything of it is in these runs' torque."""
        return any(run.any() for run in self.filtered)

    @property
    def is_event(self) -> bool:
        """Whether it belongs to the runs it was seen in, and not to the robot."""
        return self.description.is_event

    @property
    def is_free(self) -> bool:
        """Whether it is a free function of the motion, under no law."""
        return self.family.effect.startswith(FREE)

    @property
    def is_common_delay(self) -> bool:
        """Whether it has the torque of all joints act late."""
        return self.description.late and self.family.joint is None

    @property
    def is_late_alone(self) -> bool:
        """Whether it has one joint's torque act late, and no other's."""
        description = self.description
        return description.late and not description.is_lag and self.family.joint is not None

    @property
    def place(self) -> Place:
        """Effect, joint and second joint."""
        return self.family.effect, self.family.joint, self.family.into


def candidate(prepared: Prepared, family: Family, member: Member) -> Candidate:
    """A member with its columns filtered for every run."""
    columns, rows = member.columns, member.rows
    if isinstance(columns, WindowedColumns):
        each_run = zip(prepared.runs, columns.windows, strict=True)
        filtered = [run.filtered_windows(windows, rows, member.count) for run, windows in each_run]
    elif isinstance(columns, ColumnsByInstant):
        makes = (partial(columns.of_part, index) for index in range(len(prepared.runs)))
        each_make = zip(prepared.runs, makes, strict=True)
        filtered = [run.filtered_in_parts(make, rows, member.count) for run, make in each_make]
    else:
        filtered = [run.filtered(own, rows) for run, own in zip(prepared.runs, columns, strict=True)]
    samples = sum(run.logged.samples for run in prepared.runs)
    steps = prepared.sample_time, prepared.position_step
    return Candidate(family, member, tuple(filtered), prepared.joints, samples, *steps)


def without_law(
    prepared: Prepared,
    name: str,
    joint: int,
    columns: ColumnsByRun,
    lower: Array,
    shape: dict[str, float],
) -> Candidate:
    """Functions of the motion on a joint's torque, a run (N, 1, k), under no law of the catalogue.

    lower: (k,) bounds of the coefficients. Only the filtered columns are kept.
    """
    at_full_rate = Member(shape, (joint,), columns, lower, np.full(len(lower), np.inf))
    kept = replace(at_full_rate, columns=())
    filtered = candidate(prepared, Family(name, joint, (kept,), _no_parameters), at_full_rate)
    return replace(filtered, member=kept)


def _no_parameters(member: Member, c: Array, covariance: Array) -> dict[str, Quantity]:
    return {}


def candidates(
    prepared: Prepared,
    without: Sequence[str] = (),
    only: Sequence[str] | None = None,
    known: Sequence[Candidate] = (),
) -> list[Candidate]:
    """All members of all families of the catalogue, less the effects taken out of it (or only some).

    known: those of the same runs and loads by another friction, of which what it does not change is taken.
    """
    logged, same = [run.logged for run in prepared.runs], defaultdict(list)
    for each in known:
        if not each.description.of_friction:
            same[each.place].append(each)
    wanted = [
        (name, joint, into)
        for name, each in effects().items()
        if name not in without and (only is None or name in only)
        for joint, into in places(each.DESCRIPTION, prepared.robot.chain.is_slide)
        if prepared.moves(joint, into)
    ]
    # As many joints at a time as derivatives of the load are kept of: threads seldom make the same ones.
    at_once = min(run.joints_kept for run in logged)
    anew = sorted(
        (place for place in wanted if place not in same), key=lambda place: (place[1] or 0) // at_once
    )
    for each in in_parallel(prepared, [partial(effect(name).signature, logged, j, k) for name, j, k in anew]):
        same[each.place].append(each)
    return [each for place in wanted for each in same[place]]


def in_parallel(prepared: Prepared, families: Sequence[Callable[[], Family]]) -> list[Candidate]:
    """All members of families that are yet to be made, in their order, on all cores."""

    def members(family: Callable[[], Family]) -> list[Candidate]:
        made = family()
        return [candidate(prepared, made, member) for member in made.members]

    size = sum(run.logged.q.nbytes for run in prepared.runs)
    workers = min(os.cpu_count() or 1, max(MOST_AT_ONCE // max(size, 1), 1))
    with ThreadPoolExecutor(workers) as pool:
        return [each for found in pool.map(members, families) for each in found]
