"""What several effects that were taken in say together: laws that no catalogue holds."""

from dataclasses import replace

import pytest

from diagnosis.data.preparation import prepare
from diagnosis.fit.score import Stage
from diagnosis.model.base_regressor import BaseRegressor
from diagnosis.model.candidates import candidates
from diagnosis.plausibility.accepted import (
    is_rest,
    laws_of_position,
    without_rests,
)

from ...diagnosed import simulated_runs
from ..accepted_effects import accepted_of


@pytest.fixture(scope="module")
def prepared(arm):
    return prepare(arm, simulated_runs(arm, [], runs=1))


@pytest.mark.parametrize(
    ("first", "share", "kept", "joints"),
    [
        ("gravity_spring", 0.998, 1, []),
        ("gravity_spring", 0.97, 2, [1]),
        # A hose stiffens as it is pulled.
        ("cable_spring", 0.97, 1, []),
        ("cable_spring", 0.9, 2, [1]),
    ],
)
def test_two_laws_of_position_are_none_unless_one_all_but_explains_the_joint(
    prepared, first, share, kept, joints
):
    names = sorted(("gravity_spring", "cable_spring"), key=lambda name: name != first)
    one, other = (next(c for c in candidates(prepared, only=[name]) if c.family.joint == 1) for name in names)
    found = without_rests([replace(accepted_of(one), share=share), replace(accepted_of(other), share=0.7)])
    assert [each.candidate.family.effect for each in found] == names[:kept]
    stage = Stage.of(BaseRegressor(prepared), [])
    assert [each.joint for each in laws_of_position(stage, stage, found)] == joints


@pytest.mark.parametrize(("share", "expected"), [(0.97, True), (0.9, False)])
def test_a_rest_of_a_law_of_position_is_one_whether_it_has_a_name_or_not(prepared, share, expected):
    cable, spring = (
        next(accepted_of(c) for c in candidates(prepared, only=[name]) if c.family.joint == 1)
        for name in ("cable_spring", "gravity_spring")
    )
    cable, spring = replace(cable, share=share), replace(spring, share=0.7, named=False)
    assert is_rest(spring, [cable, spring]) == expected
    # Beside what has no name itself it is none.
    assert not is_rest(spring, [replace(cable, named=False), spring])
