"""What no effect explains, where no function of the motion does either."""

import numpy as np
import pytest

from diagnosis.evidence import fitted_to
from diagnosis.generic import generic_candidates
from diagnosis.ground import ground
from diagnosis.preparation import prepare
from diagnosis.unclaimed import NOTHING, unclaimed
from diagnosis.weighing import Bank, Stage
from testbench.effects import parse_injection

from .diagnosed import simulated_runs
from .small_arm import small_arm


def _unclaimed(arm, runs):
    prepared = prepare(arm, runs)
    stage = Stage(ground(prepared), *fitted_to(prepared, []))
    free = Bank(stage.ground, generic_candidates(prepared))
    left = np.sqrt(stage.held_squares / stage.counts) / stage.ground.torque_rms
    return unclaimed(stage, stage, free), left


@pytest.mark.parametrize(("stiffness", "expected"), [(1500, False), (350, True)])
def test_what_is_slow_and_large_is_unknown_though_every_joint_has_as_much(tmp_path, stiffness, expected):
    arm = small_arm(tmp_path)
    fault = parse_injection(arm, f"joint_elasticity:shoulder:stiffness={stiffness},damping=4")
    found, _ = _unclaimed(arm, simulated_runs(arm, [fault], runs=3))
    assert ((0, NOTHING) in [(each.joint, each.regime) for each in found]) == expected


def test_noise_is_nothing_however_large(tmp_path):
    arm = small_arm(tmp_path)
    found, left = _unclaimed(arm, simulated_runs(arm, [], runs=3, noise=6.0))
    assert left.max() > 0.05
    assert found == ()
