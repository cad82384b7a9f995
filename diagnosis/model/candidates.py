"""Candidate effects on these runs: every family's columns, filtered like the torque."""

import os
from collections import defaultdict
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from testbench.effects import effect, effects
from testbench.effects.columns import ColumnsByInstant, ColumnsByRun, WindowedColumns
from testbench.effects.signature import Family, Member, Quantity, places

from ..data.run import Prepared
from .candidate import Candidate

Array = NDArray[np.float64]

# Bytes of all joints' samples at the full rate: families that are made at the same time share so many.
MOST_AT_ONCE = 1 << 26


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
    of_runs = prepared.sample_time, prepared.position_step, prepared.largest_torque
    return Candidate(family, member, tuple(filtered), prepared.joints, samples, *of_runs)


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
