"""Signatures of friction, against laws written here in closed form."""

from dataclasses import replace

import numpy as np
import pytest

from identification.parameters import PER_JOINT, VISCOUS
from testbench.effects import effects
from testbench.effects.signature import Logged
from testbench.robot import Robot

from ..closed_form_arm import (
    DQ,
    FINE,
    FINE_STEP,
    FINENESS,
    RATE,
    TIME,
    J,
    link_side,
    on_joint,
    single,
    unexplained,
)


def test_stribeck_is_explained(arm: Robot, base: np.ndarray, logged: Logged) -> None:
    v = DQ[:, J]
    torque = on_joint(1.3 * np.exp(-((np.abs(v) / 0.2) ** 1.5)) * np.sign(v))
    left, found = unexplained(base, torque, effects()["stribeck_friction"].signature([logged], J, None))
    assert left < 0.1
    assert found["extra"] == pytest.approx(1.3, rel=0.3)


def test_asymmetric_friction_is_explained_exactly(arm: Robot, base: np.ndarray, logged: Logged) -> None:
    torque = on_joint(0.4 - 0.7 * np.abs(DQ[:, J]))
    left, found = unexplained(base, torque, effects()["asymmetric_friction"].signature([logged], J, None))
    assert left < 1e-9
    assert found["viscous_difference"] == pytest.approx(-0.7)


@pytest.mark.parametrize("exponent", [0.4, 0.6, 2.0])
def test_nonlinear_viscous_friction_is_explained(
    arm: Robot, base: np.ndarray, logged: Logged, exponent: float
) -> None:
    v = DQ[:, J]
    torque = on_joint(2.0 * np.abs(v) ** exponent * np.sign(v))
    family = effects()["nonlinear_viscous_friction"].signature([logged], J, None)
    assert unexplained(base, torque, family)[0] < 0.1


@pytest.mark.parametrize("driven", [1.0, 0.5])
def test_load_friction_is_explained(arm: Robot, base: np.ndarray, logged: Logged, driven: float) -> None:
    _, load, _ = link_side(arm, J)
    direction = np.sign(DQ[:, J])
    torque = on_joint(np.where(load * direction < 0, driven, 1.0) * 0.08 * np.abs(load) * direction)
    left, found = unexplained(base, torque, effects()["load_dependent_friction"].signature([logged], J, None))
    assert left < 1e-9
    assert found["coefficient"] == pytest.approx(0.08)


@pytest.mark.parametrize("exponent", [1.0, 2.0])
@pytest.mark.parametrize("displacement", [0.0015, 0.006])
def test_presliding_is_explained(
    arm: Robot, base: np.ndarray, logged: Logged, displacement: float, exponent: float
) -> None:
    v = DQ[:, J]
    stiffness = 2.0 / displacement
    z, fine = [0.0], np.interp(FINE, TIME, v).tolist()
    for speed in fine[1:]:
        left = max(1 - np.sign(speed) * stiffness * z[-1] / 2.0, 0.0)
        z.append(z[-1] + FINE_STEP * speed * left**exponent)
    torque = on_joint(stiffness * np.array(z)[::FINENESS] - 2.0 * np.sign(v))
    family = effects()["presliding_hysteresis"].signature([logged], J, None)
    left, found = unexplained(base, torque, family)
    assert left < 0.1
    assert found["stiffness"] == pytest.approx(stiffness, rel=0.5)
    left, found = unexplained(base, torque, single(family, displacement=displacement, exponent=exponent))
    assert left < 0.02
    assert found["stiffness"] == pytest.approx(stiffness, rel=0.02)


@pytest.mark.parametrize("power", [13.0, 26.0])
def test_thermal_drift_is_explained(arm: Robot, base: np.ndarray, logged: Logged, power: float) -> None:
    v = DQ[:, J]
    warm = [0.0]
    # What has warmed makes less heat.
    for speed in v[1:].tolist():
        heat = (3 * (1 - 0.4 * warm[-1]) * abs(speed) + 2) * abs(speed)
        warm.append(warm[-1] + (heat / power - warm[-1]) / (12.0 * RATE))
    torque = on_joint(-0.4 * 3 * np.array(warm) * v)
    family = effects()["thermal_friction_drift"].signature([logged], J, None)
    of_these_runs = family.members[0].shape["power"]
    assert of_these_runs == pytest.approx(np.mean((3 * np.abs(v) + 2) * np.abs(v)), rel=1e-3)
    at_it = single(family, time_constant=12.0, carried=0.0, paused=1.0, even=0.0, power=of_these_runs)
    left, found = unexplained(base, torque, at_it)
    assert left < 0.01
    # A drop at one friction power is that at another by their ratio.
    assert found["drop"] / found["power"] == pytest.approx(0.4 / power, rel=0.07)


def test_only_rising_friction_is_flattened(logged: Logged) -> None:
    family = effects()["nonlinear_viscous_friction"].signature([logged], J, None)
    assert [m.lower[0] == 0 for m in family.members] == [m.shape["exponent"] < 1 for m in family.members]


def test_warmth_is_carried_from_run_to_run_or_not(logged: Logged) -> None:
    family = effects()["thermal_friction_drift"].signature([logged, logged], J, None)
    shape = {"time_constant": 15.0, "power": 5.0, "paused": 1.0, "even": 0.0}
    cold, warm = (family.member({**shape, "carried": carried}) for carried in (0.0, 1.0))
    first, second = (columns[:, 0, 0] / DQ[:, J] for columns in warm.columns)
    assert second[0] == pytest.approx(first[-1], rel=1e-3)
    np.testing.assert_array_equal(cold.columns[0], cold.columns[1])
    np.testing.assert_array_equal(cold.columns[0], warm.columns[0])


def test_a_joint_may_warm_by_the_clock_whatever_it_does(logged: Logged) -> None:
    family = effects()["thermal_friction_drift"].signature([logged], J, None)
    shape = {"time_constant": 15.0, "power": 5.0, "carried": 0.0, "paused": 1.0, "even": 1.0}
    warm = family.member(shape).columns[0][:, 0, 0] / -DQ[:, J] / 3
    np.testing.assert_allclose(warm, 1 - np.exp(-TIME / 15.0), atol=1e-3)


@pytest.mark.parametrize("given", [(0, 1), (1, 0)])
@pytest.mark.parametrize("pause", [5.0, 60.0])
def test_warmth_goes_on_between_runs_of_one_clock_in_whatever_order_they_are_given(
    logged: Logged, pause: float, given: tuple[int, int]
) -> None:
    later = replace(logged, time=logged.time + logged.time[-1] + pause)
    runs = [(logged, later)[index] for index in given]
    family = effects()["thermal_friction_drift"].signature(runs, J, None)
    shape = {"time_constant": 15.0, "power": 5.0, "carried": 1.0, "even": 0.0}
    for paused, towards in ((1.0, 0.0), (0.0, 1.0)):
        columns = family.member({**shape, "paused": paused}).columns
        before, after = (columns[given.index(run)][:, 0, 0] / -DQ[:, J] / 3 for run in (0, 1))
        left = np.exp(-pause / 15.0)
        assert after[0] == pytest.approx(towards + (before[-1] - towards) * left, rel=0.01)


@pytest.mark.parametrize(("nominal", "shows"), [(3.0, True), (0.0, False)])
def test_a_joint_whose_viscous_friction_the_runs_warmth_has_hidden_may_still_warm(
    logged: Logged, nominal: float, shows: bool
) -> None:
    of_joint = J * PER_JOINT + VISCOUS
    fitted, given = logged.parameters.copy(), logged.nominal.copy()
    fitted[of_joint], given[of_joint] = -0.1, nominal
    run = replace(logged, parameters=fitted, nominal=given)
    member = effects()["thermal_friction_drift"].signature([run], J, None).members[0]
    assert np.any(member.columns[0][:, 0, 0]) == shows
    assert np.any(member.columns[0][:, 0, 1])
    # What a joint has none of has no say, and does not keep the rest from being weighed.
    assert (member.upper[0] > 0) == shows
