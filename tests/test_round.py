"""What may be taken in at all."""

from diagnosis.bank import Bank
from diagnosis.candidates import candidates
from diagnosis.ground import ground
from diagnosis.likelihood import weigh
from diagnosis.preparation import prepare
from diagnosis.round import Search
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
