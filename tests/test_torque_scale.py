"""Torque that is not N·m at the joint, or not there at all: told, and no effect."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis.diagnose import diagnose
from diagnosis.link_torque import MOST, LinkTorque
from diagnosis.preparation import prepare
from diagnosis.report import words
from diagnosis.torque_scale import beyond_limits, foreign_scales, in_words
from testbench.log import Recording

from .diagnosed import simulated_runs
from .diagnosis_output.arm import ARM
from .small_arm import small_arm


def _times(runs: dict[str, Recording], factors: list[float]) -> dict[str, Recording]:
    return {name: replace(run, torque=run.torque * factors) for name, run in runs.items()}


@pytest.mark.parametrize("factors", [[0.01, 0.01], [1.0, 50.0], [0.5, 2.0], [1.0, 1.0]])
def test_what_no_model_is_off_by_is_found_with_its_factor(arm, healthy_runs, factors):
    found = foreign_scales(prepare(arm, _times(healthy_runs, factors)))
    foreign = {joint: factor for joint, factor in enumerate(factors) if factor in (0.01, 50.0)}
    # The masses and the friction are the model's.
    assert found == {joint: pytest.approx(factor, rel=0.01) for joint, factor in foreign.items()}


def test_a_factor_of_every_joint_is_told_as_one(arm):
    assert "of every joint is 0.01 times" in in_words(arm, {0: 0.008, 1: 0.0125}, {})
    assert "of shoulder is 0.01, elbow is 50 times the model's:" in in_words(
        arm, {0: 0.01, 1: 50.0}, {1: 9.0}
    )
    assert not in_words(arm, {}, {})


@pytest.mark.parametrize(("factor", "found"), [(2**0.5, True), (0.5, True), (1.15, False)])
def test_a_factor_that_three_joints_share_is_no_error_of_the_model(tmp_path, factor, found):
    crane = small_arm(tmp_path, ARM)
    runs = _times(simulated_runs(crane, [], runs=2), [factor] * crane.joints)
    scales = foreign_scales(prepare(crane, runs))
    assert scales == ({joint: pytest.approx(factor, rel=0.02) for joint in range(3)} if found else {})


def test_a_joint_that_hardly_moves_tells_nothing_of_its_units(arm, healthy_runs):
    prepared = prepare(arm, _times(healthy_runs, [0.01, 1.0]))
    (first, *others), every = prepared.runs, prepared.evenly(MOST)
    moves = np.arange(len(first.time)) < 2 * every
    hardly = [replace(first, used=first.used & np.column_stack([moves, np.ones_like(moves)]))]
    hardly += [replace(run, used=run.used & [False, True]) for run in others]
    still = LinkTorque(replace(prepared, runs=tuple(hardly)))
    assert len(still.projected(still.torque)[0]) == 0
    assert still.left(still.torque)[1] > 0


def test_more_torque_than_any_drive_gives_is_told_where_the_model_says_nothing_of_it(arm, healthy_runs):
    swinging = {
        name: replace(run, torque=np.column_stack([run.torque[:, 0], 300 * np.sin(3 * run.time)]))
        for name, run in healthy_runs.items()
    }
    # The elbow's drive gives 30 N·m.
    found = beyond_limits(prepare(arm, swinging))
    assert list(found) == [1]
    assert found[1] > 5
    assert in_words(arm, {}, {1: 7.0}).startswith("The torque of elbow is 7 times what its drive can, RMS:")
    assert not beyond_limits(prepare(arm, healthy_runs))


def test_the_sentence_says_what_the_torque_may_be(arm, healthy_runs):
    found = diagnose(arm, _times(healthy_runs, [0.01, 0.01]))
    assert found.verdict == "parameters"
    assert found.sentence.startswith("The torque of every joint is 0.01 times the model's")


def test_a_joint_without_torque_spoils_nothing_of_the_others(arm, healthy_runs):
    found = diagnose(arm, _times(healthy_runs, [1.0, 0.0]))
    assert found.verdict in ("none", "parameters")
    assert words.silent(found) == ["The logged torque of elbow never changes: nothing is told of it."]
    assert words.untold(found) == []
