"""Parameters and effects fitted together, within what one expects of a model."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis.evidence import fitted_to, squares
from diagnosis.preparation import prepare
from identification.parameters import COULOMB, VISCOUS

from .diagnosed import simulated_runs
from .small_arm import small_arm

INERTIAL = slice(0, 10)


@pytest.mark.parametrize(("joint", "columns", "share"), [(1, INERTIAL, 0.02), (0, [COULOMB, VISCOUS], 0.0)])
def test_a_model_however_far_from_the_robot_is_re_identified_down_to_the_noise(
    tmp_path, joint, columns, share
):
    arm = small_arm(tmp_path)
    runs, wrong = simulated_runs(arm, [], runs=2), arm.parameters.copy().reshape(arm.joints, -1)
    wrong[joint, columns] *= share
    far = replace(arm, parameters=wrong.ravel())
    near, left = (squares(fitted_to(prepare(each, runs), [])[1].residual) for each in (arm, far))
    np.testing.assert_allclose(left, near, rtol=0.02)
