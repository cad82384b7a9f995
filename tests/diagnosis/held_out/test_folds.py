"""What is left out in turn."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis.data.preparation import prepare
from diagnosis.fit.score import Stage
from diagnosis.held_out.folds import covered, covered_for
from diagnosis.model.base_regressor import BaseRegressor
from diagnosis.model.candidates import candidates
from diagnosis.model.gram import Bank
from identification.parameters import ARMATURE, COULOMB
from testbench.effects import parse_injection
from testbench.effects.logged import logged_run
from testbench.log import Recording
from testbench.robot import Robot

from ...diagnosed import measured_only, simulated_runs
from ...small_arm import small_arm

NOISE = 0.02


@pytest.fixture
def arm(tmp_path) -> Robot:
    return small_arm(tmp_path)


def _in_turn(arm: Robot) -> dict[str, Recording]:
    """Three runs in each of which one joint moves, the last two the same; the model's friction is wrong."""
    true = arm.parameters.copy().reshape(arm.joints, -1)
    true[:, [ARMATURE, COULOMB]] *= 2
    runs = {}
    for index, (name, run) in enumerate(simulated_runs(arm, [], runs=3).items()):
        still = 1 if index == 0 else 0
        position = run.position.copy()
        position[:, still] = position[0, still]
        noise = np.random.default_rng(index).normal(0, NOISE, position.shape)
        alone = replace(run, position=position, velocity=None)
        along = logged_run(arm, alone, true.ravel(), 40.0)
        runs[name] = replace(alone, torque=along.predicted + noise)
    return runs


def test_a_run_of_a_joint_that_no_other_moves_is_left_out_in_parts(arm):
    folds = covered(prepare(arm, _in_turn(arm))).folds
    assert [run for run, _ in folds] == [0, 0, 0, 1, 2]


def test_runs_that_move_everything_are_left_out_whole(arm):
    prepared = prepare(arm, simulated_runs(arm, [], runs=3))
    assert covered(prepared).folds == prepared.folds


def test_of_a_single_run_in_which_joints_move_in_turn_short_parts_are_left_out(arm):
    runs = list(_in_turn(arm).values())
    position, torque = (
        np.concatenate([getattr(run, name) for run in runs]) for name in ("position", "torque")
    )
    one = replace(
        measured_only(runs[0]),
        time=np.arange(len(position)) / runs[0].sample_rate,
        position=position,
        torque=torque,
    )
    assert len(covered(prepare(arm, {"run_1": one})).folds) == 12


@pytest.mark.parametrize(("acts", "folds"), [(True, [0, 0, 0, 1, 2]), (False, [0, 1, 2])])
def test_a_run_that_alone_shows_an_effect_is_left_out_in_parts(arm, acts, folds):
    faults = [parse_injection(arm, "backlash:elbow:gap=0.002")] if acts else []
    runs = simulated_runs(arm, [], runs=3)
    prepared = prepare(arm, runs | {"run_1": simulated_runs(arm, faults, runs=3)["run_1"]})
    stage = Stage.of(BaseRegressor(prepared), [])
    (play,) = (
        each
        for each in candidates(prepared, only=["backlash"])
        if each.family.joint == 1 and each.member.shape["gap"] == 0.0015
    )
    of_one = replace(play, filtered=(play.filtered[0], *(np.zeros_like(run) for run in play.filtered[1:])))
    found = covered_for(stage, Bank(stage.base, [of_one]))
    assert [run for run, _ in found.folds] == folds
