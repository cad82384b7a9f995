"""How large an effect is against what healthy robots have of it, and what no arm has."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis.data.preparation import prepare
from diagnosis.model.base_regressor import BaseRegressor
from diagnosis.model.candidates import candidate, candidates
from diagnosis.model.effect_sizes import (
    is_beyond_healthy,
    is_excessive,
    is_plausible,
    quantities,
    times_healthy,
)
from identification.parameters import COULOMB, MASS
from testbench.effects import effect
from testbench.effects.size import scale_of, typical_range

from ...diagnosed import simulated_runs
from ...small_arm import ARM, small_arm


def _first_of(arm, name, joint):
    """A run of the arm, prepared, and the first candidate of an effect at a joint."""
    prepared = prepare(arm, simulated_runs(arm, [], runs=1))
    return prepared, next(c for c in candidates(prepared, only=[name]) if c.family.joint == joint)


@pytest.mark.parametrize(("share", "is_named"), [(0.4, False), (1.0, True)])
def test_bristles_bear_all_of_a_joints_coulomb_friction(tmp_path, share, is_named):
    arm = small_arm(tmp_path)
    prepared = prepare(arm, simulated_runs(arm, [], runs=1))
    softest = max(
        candidates(prepared, only=["presliding_hysteresis"]),
        key=lambda each: each.member.shape["displacement"],
    )
    level = share * arm.parameters.reshape(arm.joints, -1)[softest.family.joint, COULOMB]
    torque = BaseRegressor(prepared).torque_rms
    assert is_beyond_healthy(arm, torque, softest, np.array([level])) == is_named


@pytest.mark.parametrize("rotor", [0.0, 0.05, 0.5])
def test_a_gearbox_swings_with_its_link_however_heavy_the_rotor(tmp_path, rotor):
    """Of a wrist with one of more than twenty times the link it is taken to carry more."""
    arm = small_arm(tmp_path, ARM.replace('armature=".05"', f'armature="{rotor}"'))
    prepared = prepare(arm, simulated_runs(arm, [], runs=1))
    (stiffness, *_) = effect("joint_elasticity").DESCRIPTION.parameters
    link = 0.0342  # of the elbow
    np.testing.assert_allclose(typical_range(stiffness, arm, 1), (18000 * link, 2000 * link), rtol=1e-3)
    own = [c for c in candidates(prepared, only=["joint_elasticity"]) if c.family.joint == 1]
    softest = min(own, key=lambda c: c.member.shape["stiffness"])
    stiffness = softest.member.shape["stiffness"]
    assert stiffness == pytest.approx((2 * np.pi * 4.5) ** 2 * link, rel=1e-3)
    # A column's coefficient is one at the stiffness of its shape.
    assert all(is_plausible(arm, c, np.ones(1)) for c in own)


@pytest.mark.parametrize(
    ("name", "healthy", "faulty"),
    [("thermal_friction_drift", 0.4, 0.6), ("transmission_ripple", 0.7, 0.9), ("gravity_spring", 0.7, 0.9)],
)
def test_what_healthy_robots_have_differs_from_effect_to_effect(tmp_path, name, healthy, faulty):
    arm = small_arm(tmp_path)
    _, own = _first_of(arm, name, 0)
    mild, _ = typical_range(effect(name).DESCRIPTION.parameters[0], arm, 0)
    # Of a joint that hardly needs torque: nothing but the typical range says what is much.
    torque, first = np.full(arm.joints, 1e-3), np.eye(own.count)[0]
    assert not is_beyond_healthy(arm, torque, own, healthy * mild * first)
    assert is_beyond_healthy(arm, torque, own, faulty * mild * first)


@pytest.mark.parametrize(("moved", "expected"), [(0.009, False), (0.015, True)])
def test_friction_that_differs_by_direction_is_little_where_all_friction_is(tmp_path, moved, expected):
    arm = small_arm(tmp_path)
    prepared, own = _first_of(arm, "asymmetric_friction", 0)
    speed = np.sqrt(np.mean(prepared.runs[0].logged.dq[:, 0] ** 2))
    # A joint that carries far more than it rubs: a fifth of its viscous friction is next to nothing.
    difference = scale_of("viscous", arm, 0) / 5
    torque = np.full(arm.joints, difference * speed / moved)
    assert is_beyond_healthy(arm, torque, own, np.array([0.0, difference])) == expected


@pytest.mark.parametrize(
    ("name", "shape", "amount", "share", "expected"),
    [
        ("load_dependent_friction", {}, 0.3, 0.9, True),
        ("load_dependent_friction", {}, 0.3, 0.98, False),
        ("load_dependent_friction", {}, 0.15, 0.9, False),
        ("thermal_friction_drift", {"time_constant": 3.0}, 0.5, 0.9, True),
        ("thermal_friction_drift", {"time_constant": 10.0}, 0.5, 0.9, False),
        ("nonlinear_viscous_friction", {"exponent": 2.0}, 20.0, 0.9, True),
        ("nonlinear_viscous_friction", {"exponent": 2.0}, 20.0, 0.98, False),
        ("nonlinear_viscous_friction", {"exponent": 2.0}, 1.0, 0.9, False),
    ],
)
def test_what_no_gear_has_is_something_else(tmp_path, name, shape, amount, share, expected):
    arm = small_arm(tmp_path)
    own = candidates(prepare(arm, simulated_runs(arm, [], runs=1)), only=[name])[0]
    made = replace(own, member=replace(own.member, shape=own.member.shape | shape))
    assert is_excessive(arm, made, amount * np.eye(own.count)[0], share) == expected


def test_the_nearer_an_exponent_is_to_one_the_less_friction_bends(tmp_path):
    arm = small_arm(tmp_path)
    prepared = prepare(arm, simulated_runs(arm, [], runs=1))
    family = candidates(prepared, only=["nonlinear_viscous_friction"])[0].family
    times = []
    for exponent in (1.2, 2.0):
        own = candidate(prepared, family, family.member({"exponent": exponent}))
        # As much torque at the highest speed.
        largest = max(float(np.abs(column).max()) for column in own.member.columns)
        times.append(times_healthy(arm, np.ones(arm.joints), own, np.array([1 / largest])))
    assert times[0] == pytest.approx(0.12 * times[1], rel=0.05)
    # Below one, by the coefficient.
    slow, fast = (
        times_healthy(
            arm,
            np.ones(arm.joints),
            candidate(prepared, family, family.member({"exponent": exponent})),
            np.ones(1),
        )
        for exponent in (0.94, 0.6)
    )
    assert slow == pytest.approx(0.2 * fast)


def test_friction_that_bends_more_is_larger_however_fast_the_joint_moves(tmp_path):
    arm = small_arm(tmp_path)
    prepared = prepare(arm, simulated_runs(arm, [], runs=1))
    family = candidates(prepared, only=["nonlinear_viscous_friction"])[0].family
    bent = candidate(prepared, family, family.member({"exponent": 2.0}))
    for faster in (1.0, 400.0):
        columns = tuple(faster * each for each in bent.member.columns)
        own = replace(bent, member=replace(bent.member, columns=columns))
        times = [times_healthy(arm, np.ones(arm.joints), own, np.array([amount])) for amount in (0.01, 0.02)]
        assert times[1] == pytest.approx(2 * times[0])


@pytest.mark.parametrize(
    ("effect", "parameter", "samples", "expected"),
    [
        ("actuator_lag", "time_constant", 0.4, False),
        ("actuator_lag", "time_constant", 0.8, True),
        ("torque_delay", "delay", 0.8, False),
        ("torque_delay", "delay", 1.3, True),
    ],
)
def test_what_is_late_by_less_than_a_share_of_a_sample_is_the_logs(
    tmp_path, effect, parameter, samples, expected
):
    arm = small_arm(tmp_path)
    prepared = prepare(arm, simulated_runs(arm, [], runs=1))
    lag = candidates(prepared, only=[effect])[0]
    slow = replace(lag, sample_time=0.01)
    wanted = min(
        np.geomspace(1e-4, 1.0, 400),
        key=lambda c: abs(quantities(slow, np.full(lag.count, c))[parameter].value - samples * 0.01),
    )
    assert (
        is_beyond_healthy(arm, BaseRegressor(prepared).torque_rms, slow, np.full(lag.count, wanted))
        == expected
    )


@pytest.mark.parametrize(("counts", "expected"), [(1.0, False), (4.0, True)])
def test_bristles_of_a_few_counts_of_an_encoder_are_the_encoders(tmp_path, counts, expected):
    arm = small_arm(tmp_path)
    prepared = prepare(arm, simulated_runs(arm, [], runs=1))
    bristles = candidates(prepared, only=["presliding_hysteresis"])[2]
    coarse = replace(
        bristles, position_step=np.full(arm.joints, bristles.member.shape["displacement"] / counts)
    )
    level = np.array([arm.parameters[COULOMB]])
    assert is_beyond_healthy(arm, BaseRegressor(prepared).torque_rms, coarse, level) == expected


@pytest.mark.parametrize(
    ("last", "kilograms", "expected"), [(2.0, 0.2, False), (2.0, 0.6, True), (0.2, 0.15, True)]
)
def test_a_payload_is_one_for_the_arm_that_carries_it(tmp_path, last, kilograms, expected):
    arm = small_arm(tmp_path, ARM.replace('mass="2"', f'mass="{last}"'))
    prepared = prepare(arm, simulated_runs(arm, [], runs=1))
    (payload,) = candidates(prepared, only=["payload"])
    coefficients = np.zeros(payload.count)
    coefficients[MASS] = kilograms
    torque = BaseRegressor(prepared).torque_rms
    assert is_beyond_healthy(arm, torque, payload, coefficients) == expected
