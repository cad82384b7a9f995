"""The nearest robot that could exist: its base parameters, its bounds, and that it is the nearest."""

import numpy as np
import pytest

from identification.base_parameters import BaseParameters, base_parameters
from identification.parameters import ARMATURE, GROUPS, INERTIAL, MASS, OFFSET, PER_JOINT, pseudo_inertia
from identification.physical_consistency import HEAVIEST, LIGHTEST_ROTOR, consistent_standard_parameters
from testbench.robot import load_robot

RAIL, LIFT = 0, 1
ARM = """
<mujoco><worldbody><body name="cart">
  <inertial pos="0 0 .1" mass="6" diaginertia=".05 .05 .04"/>
  <joint name="rail" type="slide" axis="1 0 0" armature="2" damping="4" frictionloss="3"/>
  <body name="upper" pos="0 0 .3">
    <inertial pos=".2 0 .02" mass="4" diaginertia=".02 .06 .06"/>
    <joint name="lift" axis="0 1 0" armature=".08" damping="3" frictionloss="4"/>
    <body name="lower" pos=".4 0 0">
      <inertial pos=".1 .01 0" mass="2" diaginertia=".002 .01 .01"/>
      <joint name="turn" axis="0 0 1" armature=".05" damping="1" frictionloss="2"/>
    </body>
  </body>
</body></worldbody></mujoco>
"""


@pytest.fixture(scope="module")
def nominal(tmp_path_factory: pytest.TempPathFactory) -> tuple[BaseParameters, np.ndarray]:
    """Base parameters of the arm, and its standard parameters."""
    path = tmp_path_factory.mktemp("arm") / "arm.xml"
    path.write_text(ARM)
    robot = load_robot(path)
    return base_parameters(robot.chain, tuple(GROUPS)), robot.parameters


def _scaled(given: np.ndarray, seed: int) -> np.ndarray:
    """Another robot that could exist."""
    factors = np.random.default_rng(seed).uniform(0.7, 1.4, (len(given) // PER_JOINT, 1))
    return (given.reshape(-1, PER_JOINT) * factors).ravel()


def _divergence(standard: np.ndarray, given: np.ndarray) -> float:
    """tr(P0^-1 P) - log det(P0^-1 P) of all links, y - log y of all rotors and friction."""
    total = 0.0
    for new, old in zip(standard.reshape(-1, PER_JOINT), given.reshape(-1, PER_JOINT), strict=True):
        ratio = np.linalg.solve(pseudo_inertia(old[:INERTIAL]), pseudo_inertia(new[:INERTIAL]))
        each = np.concatenate([np.linalg.eigvals(ratio).real, new[ARMATURE:OFFSET] / old[ARMATURE:OFFSET]])
        total += float(np.sum(each - np.log(each)))
    return total


def _written(nominal: tuple[BaseParameters, np.ndarray], values: np.ndarray, std: float) -> np.ndarray:
    base, given = nominal
    scale = np.maximum(np.abs(base.values(given)), 1e-3)
    standard = consistent_standard_parameters(base, values, np.diag((std * scale) ** 2), given)
    for link in standard.reshape(-1, PER_JOINT):
        assert np.linalg.eigvalsh(pseudo_inertia(link[:INERTIAL]))[0] > 0
    assert standard.reshape(-1, PER_JOINT)[:, ARMATURE:OFFSET].min() >= 0
    return standard


@pytest.mark.parametrize("seed", range(3))
def test_base_values_of_a_robot_that_exists_come_back_by_a_nearer_one(nominal, seed):
    base, given = nominal
    known = _scaled(given, seed)
    values = base.values(known)
    standard = _written(nominal, values, 1e-3)
    np.testing.assert_allclose(base.values(standard), values, rtol=1e-3, atol=1e-3 * np.abs(values).max())
    assert _divergence(standard, given) <= _divergence(known, given) + 1e-3


def test_the_model_itself_is_nearest_to_itself(nominal):
    base, given = nominal
    np.testing.assert_allclose(_written(nominal, base.values(given), 0.1), given, rtol=1e-4, atol=1e-6)


def test_no_link_is_written_that_outweighs_all_of_the_model(nominal):
    base, given = nominal
    asked = given.reshape(-1, PER_JOINT).copy()
    # First moments of thirty times the mass, with the inertia as it is.
    asked[2, 6:9] *= 30
    masses = _written(nominal, base.values(asked.ravel()), 0.01).reshape(-1, PER_JOINT)[:, MASS]
    assert masses[1:].max() <= HEAVIEST * given.reshape(-1, PER_JOINT)[:, MASS].max()


def test_a_mass_that_no_torque_depends_on_is_bounded_too(tmp_path):
    path = tmp_path / "wrist.xml"
    path.write_text(
        '<mujoco><worldbody><body><inertial pos="0 0 .1" mass="3" diaginertia=".02 .02 .02"/>'
        '<joint axis="0 0 1"/><body><inertial pos=".2 0 0" mass="2" diaginertia=".01 .03 .03"/>'
        '<joint axis="0 1 0"/></body></body></worldbody></mujoco>'
    )
    robot = load_robot(path)
    base, given = base_parameters(robot.chain, ("inertial",)), robot.parameters
    masses = np.arange(MASS, len(given), PER_JOINT)
    assert not base.projection[:, masses].any()
    asked = given.reshape(-1, PER_JOINT).copy()
    asked[1, :9] *= 30
    values = base.values(asked.ravel())
    scale = np.maximum(np.abs(values), 1e-3)
    standard = consistent_standard_parameters(base, values, np.diag((0.01 * scale) ** 2), given)
    assert standard[masses].max() <= HEAVIEST * 3


def test_rotors_stay_of_a_size_that_the_models_own_make_likely(nominal):
    base, given = nominal
    asked = given.reshape(-1, PER_JOINT).copy()
    asked[1:, ARMATURE] = -0.5
    standard = _written(nominal, base.values(asked.ravel()), 0.1).reshape(-1, PER_JOINT)
    rotors = standard[:, ARMATURE] / given.reshape(-1, PER_JOINT)[:, ARMATURE]
    assert np.all(rotors >= LIGHTEST_ROTOR)


def test_a_model_without_rotors_gets_none_that_the_data_speak_against(nominal):
    base, given = nominal
    without = given.reshape(-1, PER_JOINT).copy()
    without[:, ARMATURE] = 0.0
    asked = without.copy()
    asked[2, ARMATURE] = -0.01
    standard = _written((base, without.ravel()), base.values(asked.ravel()), 0.01).reshape(-1, PER_JOINT)
    assert 0 <= standard[2, ARMATURE] < 0.02 * given.reshape(-1, PER_JOINT)[2, ARMATURE] + 1e-3


def test_a_mass_that_the_data_determine_by_itself_is_written_as_it_is(tmp_path):
    path = tmp_path / "slide.xml"
    path.write_text(
        '<mujoco><worldbody><body><inertial pos="0 0 0" mass="2" diaginertia=".1 .1 .1"/>'
        '<joint type="slide" axis="0 0 1" damping="1" frictionloss="1"/></body></worldbody></mujoco>'
    )
    robot = load_robot(path)
    base = base_parameters(robot.chain, ("inertial", "viscous", "coulomb"))
    values = base.values(robot.parameters * np.where(np.arange(PER_JOINT) == MASS, 5.0, 1.0))
    standard = consistent_standard_parameters(base, values, np.diag((0.01 * values) ** 2), robot.parameters)
    assert standard[MASS] == pytest.approx(10.0, rel=0.01)


@pytest.mark.parametrize("seed", [5, 8, 11])
def test_an_estimate_far_from_any_robot_still_has_a_nearest_one(nominal, seed):
    base, given = nominal
    impossible = given * np.random.default_rng(seed).normal(1.0, 10.0, given.size)
    _written(nominal, base.values(impossible), 1e-4)
