"""What may be taken in at all, and what of it is certain."""

import pytest

from diagnosis.bank import Bank
from diagnosis.candidates import candidates
from diagnosis.evidence import Fit
from diagnosis.ground import ground
from diagnosis.likelihood import weigh
from diagnosis.preparation import prepare
from diagnosis.round import Found, Search
from diagnosis.weighing import Stage

from .diagnosed import simulated_runs
from .small_arm import small_arm


def test_what_all_runs_together_fit_as_nothing_is_not_open(tmp_path):
    arm = small_arm(tmp_path)
    prepared = prepare(arm, simulated_runs(arm, [], runs=3))
    stage = Stage.of(ground(prepared), [])
    # Neither can be less than nothing, so noise alone often fits them as just that.
    bounded = Bank(stage.ground, candidates(prepared, only=["actuator_lag", "joint_elasticity"]))
    assert any(each.gain.wald < 1e-3 for each in weigh(stage, bounded))
    opened = Search(stage, arm, [], ()).open(stage, bounded)
    assert all(each.gain.wald > 1 for each in opened)


@pytest.mark.parametrize(
    ("effect", "is_trace", "expected"),
    [("torque_gain_error", True, True), ("torque_gain_error", False, False), ("encoder_offset", True, False)],
)
def test_three_deviations_are_certain_of_a_gain_that_is_a_trace(
    tmp_path, monkeypatch, effect, is_trace, expected
):
    arm = small_arm(tmp_path)
    prepared = prepare(arm, simulated_runs(arm, [], runs=3))
    stage = Stage.of(ground(prepared), [])
    best = weigh(stage, Bank(stage.ground, candidates(prepared, only=[effect])))[0]
    monkeypatch.setattr(Fit, "wald", lambda *_: 12.0)
    found = Found(best, (), stage.with_effects([best.candidate]), is_trace)
    assert found.is_certain(stage) == expected
