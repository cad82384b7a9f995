"""Parameters and effects fitted together, within what one expects of a model."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis.data.preparation import prepare
from diagnosis.fit.normal_equations import fitted_to, squares
from diagnosis.model.base_regressor import BaseRegressor
from diagnosis.model.hypothesis import BEST_MODEL
from identification.parameters import COULOMB, VISCOUS

from ...diagnosed import simulated_runs
from ...small_arm import small_arm

INERTIAL = slice(0, 10)
# Places of the kinds among the prior's scales.
LINKS, FRICTION = 0, 1


@pytest.mark.parametrize(("joint", "columns", "share"), [(1, INERTIAL, 0.02), (0, [COULOMB, VISCOUS], 0.0)])
def test_a_model_however_far_from_the_robot_is_re_identified_down_to_the_noise(
    tmp_path, joint, columns, share
):
    arm = small_arm(tmp_path)
    runs, wrong = simulated_runs(arm, [], runs=2), arm.parameters.copy().reshape(arm.joints, -1)
    wrong[joint, columns] *= share
    far = replace(arm, parameters=wrong.ravel())
    near, left = (
        squares(fitted_to(BaseRegressor(prepare(each, runs)), [])[1].residual) for each in (arm, far)
    )
    np.testing.assert_allclose(left, near, rtol=0.02)


def test_the_better_a_model_the_tighter_it_holds_its_parameters(tmp_path):
    arm = small_arm(tmp_path)
    runs, scales = simulated_runs(arm, [], runs=2), []
    for error in (0.0, 0.3, 3.0):
        masses = arm.parameters.copy().reshape(arm.joints, -1)
        masses[:, INERTIAL] *= 1 + error
        model = replace(arm, parameters=masses.ravel())
        scales.append(fitted_to(BaseRegressor(prepare(model, runs)), [])[1].prior_scales[LINKS])
    right, poor, wrong = scales
    assert BEST_MODEL <= right < 1.5 * BEST_MODEL
    assert 2 * right < poor < 1 < wrong


def test_links_are_held_tightly_beside_friction_that_nobody_knew(tmp_path):
    arm = small_arm(tmp_path)
    friction = arm.parameters.copy().reshape(arm.joints, -1)
    friction[:, [VISCOUS, COULOMB]] *= 2.5
    model = replace(arm, parameters=friction.ravel())
    scales = fitted_to(BaseRegressor(prepare(model, simulated_runs(arm, [], runs=2))), [])[1].prior_scales
    assert scales[FRICTION] > 1
    assert scales[LINKS] < 1.5 * BEST_MODEL
