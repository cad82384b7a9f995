"""Robots of several branches: what one branch's log has otherwise is looked for on that branch."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import pytest

from recordings.checks.convention import as_modelled
from recordings.checks.convention_search import Candidate, doubtful_joints
from recordings.checks.conventions import check
from recordings.checks.subject import Subject
from testbench.log import Recording
from testbench.robot import Robot

from ..diagnosed import simulated_runs
from ..simulated_arm import robot_from
from ..trees import FOUR_LEGS

# The joints of the second leg.
LEG = (3, 4, 5)


@pytest.fixture(scope="module")
def legs(tmp_path_factory: pytest.TempPathFactory) -> Robot:
    return robot_from(FOUR_LEGS, tmp_path_factory.mktemp("legs"))


@pytest.fixture(scope="module")
def healthy(legs: Robot) -> Mapping[str, Recording]:
    return simulated_runs(legs, [])


def _reordered(run: Recording, order: Sequence[int]) -> Recording:
    return replace(
        run,
        position=run.position[:, order],
        velocity=None if run.velocity is None else run.velocity[:, order],
        torque=run.torque[:, order],
    )


@pytest.mark.parametrize("columns", [(3, 5, 4), (5, 3, 4)])
def test_columns_passed_round_on_one_leg_are_found(
    legs: Robot, healthy: Mapping[str, Recording], columns: Sequence[int]
) -> None:
    order = np.arange(legs.joints)
    order[list(LEG)] = columns
    found = check(Subject(legs, {name: _reordered(run, order) for name, run in healthy.items()}))
    moved = tuple(legs.joint_names[joint] for joint in LEG if order[joint] != joint)
    assert [(each.code, each.joints) for each in found] == [("joint_order", moved)]


def test_only_the_branch_of_a_torque_that_is_not_explained_isdoubtful_joints(
    legs: Robot, healthy: Mapping[str, Recording]
) -> None:
    fit = Subject(legs, healthy).fit
    assert fit is not None
    plain = Candidate(as_modelled(legs.joints), fit.under(as_modelled(legs.joints)))
    assert doubtful_joints(legs.chain, plain) == []
    left = plain.explained.left.copy()
    left[LEG[1]] = 0.5
    odd = replace(plain, explained=replace(plain.explained, left=left))
    assert doubtful_joints(legs.chain, odd) == list(LEG)
