"""What is worth a name."""

import numpy as np
import pytest

from diagnosis.candidates import candidates
from diagnosis.ground import ground
from diagnosis.materiality import is_beyond_healthy, is_plausible
from diagnosis.preparation import prepare
from identification.parameters import COULOMB
from testbench.effects.size import scale_of

from .diagnosed import simulated_runs
from .small_arm import small_arm


@pytest.mark.parametrize(("share", "is_named"), [(0.4, False), (1.0, True)])
def test_bristles_bear_all_of_a_joints_coulomb_friction(tmp_path, share, is_named):
    arm = small_arm(tmp_path)
    prepared = prepare(arm, simulated_runs(arm, [], runs=1))
    softest = max(
        candidates(prepared, only=["presliding_hysteresis"]),
        key=lambda each: each.member.shape["displacement"],
    )
    level = share * arm.parameters.reshape(arm.joints, -1)[softest.family.joint, COULOMB]
    torque = ground(prepared).torque_rms
    assert is_beyond_healthy(arm, torque, softest, np.array([level])) == is_named


@pytest.mark.parametrize(("share", "is_met"), [(0.6, True), (3.0, False)])
def test_a_gas_spring_stronger_than_any_counterbalance_is_another_law(tmp_path, share, is_met):
    arm = small_arm(tmp_path)
    prepared = prepare(arm, simulated_runs(arm, [], runs=1))
    gas = next(c for c in candidates(prepared, only=["gravity_spring"]) if c.member.law == "gas_spring")
    stiffness = share * scale_of("gravity", arm, gas.family.joint)
    assert is_plausible(arm, gas, np.array([stiffness])) == is_met
