"""Effects of a size that these runs do not determine, or that left-out runs do not keep, are no causes."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from diagnosis.decision.doubts import (
    AT_ITS_BOUND,
    NOT_PREDICTED,
    SECOND,
    UNCERTAIN,
    acts_on,
    doubt,
    is_too_short,
    with_support,
    without_seconds,
)
from diagnosis.plausibility.accepted import Accepted
from testbench.effects.signature import Quantity


def _named(effect: str, **parameters: tuple[Any, Any]) -> Any:
    quantities = {name: Quantity(value, std, "-") for name, (value, std) in parameters.items()}
    return SimpleNamespace(effect=effect, parameters=quantities)


@pytest.mark.parametrize(
    ("named", "expected"),
    [
        (_named("thermal_friction_drift", drop=(0.95, 0.02), time_constant=(6.9, 1.0)), AT_ITS_BOUND),
        (_named("thermal_friction_drift", drop=(0.31, 1.5), time_constant=(20.0, 1.0)), UNCERTAIN),
        (_named("thermal_friction_drift", drop=(0.31, 0.05), time_constant=(20.0, 1.0)), ""),
        (_named("torque_gain_error", relative=(-0.5, 0.01)), AT_ITS_BOUND),
        # One of the two may be nothing.
        (_named("joint_coupling", viscous=(0.0, 0.2), coulomb=(2.0, 0.1)), ""),
        (_named("asymmetric_friction", offset=(1.0, 0.1), viscous_difference=(0.1, 0.5)), ""),
        # About a vertical axis no mass is felt but by its lever.
        (_named("payload", mass=(1.8, 2.2), first_moment=((0.6, 0.3, 0.0), (0.1, 0.1, 0.7))), ""),
        (_named("payload", mass=(1.8, 2.2), first_moment=((0.1, 0.1, 0.0), (0.2, 0.2, 0.7))), UNCERTAIN),
    ],
)
def test_a_size_at_its_bound_or_less_than_its_deviation_is_doubtful(named, expected):
    assert doubt(named) == expected


def _taken_in(
    joint: int | None, into: int | None = None, swallowed: bool = False, event: bool = False
) -> Accepted:
    family = SimpleNamespace(effect="e", joint=joint, into=into, swallowed=swallowed)
    known = SimpleNamespace(at_times=event)
    candidate: Any = SimpleNamespace(family=family, description=known, is_event=event, shows=True)
    return Accepted(candidate, 1.0, (), 10.0, 0.5, 0.1)


@pytest.mark.parametrize(
    ("joint", "into", "rows", "acts"),
    [(2, None, (0, 1, 2), True), (1, None, (0, 1), False), (1, 2, (1,), True), (None, None, (1, 2), True)],
)
def test_an_effect_acts_on_its_joints_and_one_of_the_whole_robot_on_all_that_it_loads(
    joint, into, rows, acts
):
    item = _taken_in(joint, into)
    item.candidate.member = SimpleNamespace(rows=rows)
    assert acts_on(item, {2}) == acts


def test_a_name_is_lost_where_left_out_runs_keep_nothing_of_the_effects():
    items = [
        _taken_in(0),
        _taken_in(1),
        _taken_in(0, into=1),
        _taken_in(0, into=2),
        _taken_in(2, swallowed=True),
        _taken_in(2, event=True),
    ]
    found = with_support(items, np.array([False, True, False]))
    assert [each.named for each in found] == [False, True, True, False, True, True]
    assert [each.doubt for each in found] == [NOT_PREDICTED, "", "", NOT_PREDICTED, "", ""]


@pytest.mark.parametrize(
    ("joint", "rows", "expected"),
    [(None, (0,), True), (None, (0, 2), True), (None, (0, 1, 2), False), (0, (0,), False)],
)
def test_an_effect_of_the_robot_needs_a_joint_of_enough_samples(joint, rows, expected):
    family, member = SimpleNamespace(joint=joint), SimpleNamespace(rows=rows)
    item: Any = SimpleNamespace(candidate=SimpleNamespace(family=family, member=member))
    assert is_too_short(item, np.array([False, True, False])) == expected


def test_of_the_laws_of_one_joint_the_one_that_explains_most_keeps_its_name():
    first, second = replace(_taken_in(0), worth=0.05), _taken_in(0)
    elsewhere, push = replace(_taken_in(1), worth=0.01), replace(_taken_in(0, event=True), worth=0.01)
    unnamed = replace(_taken_in(1), worth=0.3, named=False)
    found = without_seconds([first, second, elsewhere, push, unnamed])
    assert [item.named for item in found] == [False, True, True, True, False]
    assert [item.doubt for item in found] == [SECOND, "", "", "", ""]
