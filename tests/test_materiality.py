"""What is worth a name."""

import numpy as np
import pytest

from diagnosis.candidates import candidates
from diagnosis.ground import ground
from diagnosis.materiality import is_beyond_healthy
from diagnosis.preparation import prepare
from identification.parameters import COULOMB

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
