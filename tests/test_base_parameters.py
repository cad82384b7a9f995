"""Base parameters of models whose right angles are rounded, as those of most URDFs are."""

from dataclasses import replace

import numpy as np
import pytest

from identification.base_parameters import BaseParameters, base_parameters
from identification.chain import Chain
from identification.parameters import GROUPS
from identification.regressor import regressor
from testbench.robot import load_robot

from .small_arm import small_arm

RIGHT_ANGLE = "1.5707963267948966"
ARM = f"""
<mujoco model="square_arm">
  <compiler angle="radian"/>
  <worldbody>
    <body name="l1" pos="0 0 .3">
      <inertial pos=".01 0 -.05" mass="8" diaginertia=".05 .05 .04"/>
      <joint name="j1" axis="0 0 1" armature=".8" damping="4" frictionloss="5"/>
      <body name="l2" pos="0 0 .1" euler="{RIGHT_ANGLE} 0 0">
        <inertial pos=".18 .01 .02" mass="5" diaginertia=".02 .08 .08"/>
        <joint name="j2" axis="0 0 1" armature=".7" damping="3" frictionloss="4"/>
        <body name="l3" pos=".4 0 0">
          <inertial pos=".15 .005 -.01" mass="3" diaginertia=".006 .03 .03"/>
          <joint name="j3" axis="0 0 1" armature=".2" damping="1.2" frictionloss="1.5"/>
        </body>
      </body>
    </body>
  </worldbody>
</mujoco>
"""


def _rows(chain: Chain, base: BaseParameters) -> np.ndarray:
    """The base regressor along a motion, stacked."""
    time = np.arange(1500)[:, None] / 100
    rate, phase = np.array([[0.9, 1.7, 2.3]]), np.array([[0.0, 1.0, 2.0]])
    slow, fast = rate * time + phase, 2.3 * rate * time - phase
    q = np.sin(slow) + 0.5 * np.sin(fast)
    dq = rate * (np.cos(slow) + 1.15 * np.cos(fast))
    ddq = -(rate**2) * (np.sin(slow) + 2.645 * np.sin(fast))
    return regressor(chain, q, dq, ddq, base.columns).reshape(-1, base.count)


def _condition(rows: np.ndarray) -> float:
    return float(np.linalg.cond(rows / np.linalg.norm(rows, axis=0)))


@pytest.mark.parametrize("rounded", ["1.570796", "1.5708", "1.57"])
def test_a_rounded_right_angle_leaves_the_base_parameters_and_their_condition_alone(tmp_path, rounded):
    exact = small_arm(tmp_path, ARM)
    path = tmp_path / "rounded.xml"
    path.write_text(ARM.replace(RIGHT_ANGLE, rounded))
    chain = load_robot(path).chain
    base, wanted = base_parameters(chain, tuple(GROUPS)), base_parameters(exact.chain, tuple(GROUPS))
    assert base.columns.tolist() == wanted.columns.tolist()
    np.testing.assert_allclose(base.projection, wanted.projection, atol=3e-4)
    if rounded != "1.57":
        assert base.names == wanted.names
    rows = _rows(chain, base)
    assert _condition(rows) == pytest.approx(_condition(_rows(exact.chain, wanted)), rel=0.02)
    # Logs of the exact robot, with noise: what is found is the truth within its deviations.
    truth = wanted.values(exact.parameters)
    noise = 0.3 * np.random.default_rng(1).standard_normal(len(rows))
    found = np.linalg.lstsq(rows, _rows(exact.chain, wanted) @ truth + noise)[0]
    std = 0.3 * np.sqrt(np.diag(np.linalg.inv(rows.T @ rows)))
    assert np.abs((found - truth) / std).max() < 4


def test_an_all_but_level_base_reveals_no_more_than_a_level_one(tmp_path):
    chain = small_arm(tmp_path, ARM).chain
    tilted = replace(chain, gravity=9.81 * np.array([np.sin(8e-4), 0, -np.cos(8e-4)]))
    base, wanted = base_parameters(tilted, tuple(GROUPS)), base_parameters(chain, tuple(GROUPS))
    assert base.columns.tolist() == wanted.columns.tolist()
    np.testing.assert_allclose(base.projection, wanted.projection, atol=2e-3)


def test_a_tilted_base_reveals_the_first_moments_of_the_first_link(tmp_path):
    chain = small_arm(tmp_path, ARM).chain
    tilted = replace(chain, gravity=9.81 * np.array([np.sin(0.1), 0, -np.cos(0.1)]))
    names = base_parameters(tilted, tuple(GROUPS)).names
    assert any(name.startswith("MX_1") for name in names)


def test_axes_that_miss_a_right_angle_by_degrees_keep_their_parameters(tmp_path):
    chain = small_arm(tmp_path, ARM.replace(RIGHT_ANGLE, "1.5")).chain
    assert base_parameters(chain, tuple(GROUPS)).count > 22
