"""What several effects that were taken in say together: laws that no catalogue holds."""

import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from diagnosis.data.preparation import prepare
from diagnosis.diagnose import diagnose
from diagnosis.fit.normal_equations import fitted_to
from diagnosis.fit.score import Stage
from diagnosis.model.base_regressor import ground
from diagnosis.model.candidates import candidates
from diagnosis.plausibility.accepted import (
    MANY,
    ONE_WAY,
    RESONANCE,
    is_rest,
    laws_of_load,
    laws_of_position,
    many_laws,
    out_of_bounds,
    resonances,
    without_rests,
)
from testbench.effects import parse_injection

from ...diagnosed import simulated_runs
from ...small_arm import SCARA, small_arm
from ..accepted_effects import accepted_of


@pytest.fixture(scope="module")
def prepared(arm):
    return prepare(arm, simulated_runs(arm, [], runs=1))


@pytest.mark.parametrize(("joints", "left", "expected"), [(2, 0.3, [0, 1]), (2, 0.01, []), (1, 0.3, [])])
def test_several_elastic_joints_that_explain_badly_are_a_resonance(prepared, joints, left, expected):
    elastic = candidates(prepared, only=["joint_elasticity"])
    items = [accepted_of(next(c for c in elastic if c.family.joint == joint)) for joint in range(joints)]
    first = Stage.of(ground(prepared), [])
    last = SimpleNamespace(held_squares=left * first.held_squares)
    found = resonances(first, last, items)
    assert [each.joint for each in found] == expected
    assert all(each.regime == RESONANCE for each in found)


@pytest.mark.parametrize(
    ("first", "share", "kept", "joints"),
    [
        ("gravity_spring", 0.998, 1, []),
        ("gravity_spring", 0.97, 2, [1]),
        # A hose stiffens as it is pulled.
        ("cable_spring", 0.97, 1, []),
        ("cable_spring", 0.9, 2, [1]),
    ],
)
def test_two_laws_of_position_are_none_unless_one_all_but_explains_the_joint(
    prepared, first, share, kept, joints
):
    names = sorted(("gravity_spring", "cable_spring"), key=lambda name: name != first)
    one, other = (next(c for c in candidates(prepared, only=[name]) if c.family.joint == 1) for name in names)
    found = without_rests([replace(accepted_of(one), share=share), replace(accepted_of(other), share=0.7)])
    assert [each.candidate.family.effect for each in found] == names[:kept]
    stage = Stage.of(ground(prepared), [])
    assert [each.joint for each in laws_of_position(stage, stage, found)] == joints


@pytest.mark.parametrize(
    ("of_gain", "gain", "named", "joints"),
    # What gains more than it loses has a gain of its own.
    [
        (1, 0.05, True, [1]),
        (1, -0.05, True, [1]),
        (1, 0.2, True, []),
        (0, 0.05, True, []),
        (1, 0.05, False, []),
    ],
)
def test_a_joint_that_loses_a_share_of_its_load_and_has_another_gain_is_not_as_good_driven_back(
    prepared, of_gain, gain, named, joints
):
    lossy = next(c for c in candidates(prepared, only=["load_dependent_friction"]) if c.family.joint == 1)
    scaled = next(c for c in candidates(prepared, only=["torque_gain_error"]) if c.family.joint == of_gain)
    first = Stage.of(ground(prepared), [])
    last = SimpleNamespace(
        held_squares=first.held_squares,
        hypothesis=SimpleNamespace(parts=[slice(0, 1), slice(1, 2)]),
        fitted=SimpleNamespace(values=np.array([0.1, gain])),
    )
    found = laws_of_load(first, last, [accepted_of(lossy), replace(accepted_of(scaled), named=named)])
    assert [each.joint for each in found] == joints
    assert all(each.regime == ONE_WAY for each in found)


@pytest.mark.parametrize(("share", "expected"), [(0.97, True), (0.9, False)])
def test_a_rest_of_a_law_of_position_is_one_whether_it_has_a_name_or_not(prepared, share, expected):
    cable, spring = (
        next(accepted_of(c) for c in candidates(prepared, only=[name]) if c.family.joint == 1)
        for name in ("cable_spring", "gravity_spring")
    )
    cable, spring = replace(cable, share=share), replace(spring, share=0.7, named=False)
    assert is_rest(spring, [cable, spring]) == expected
    # Beside what has no name itself it is none.
    assert not is_rest(spring, [replace(cable, named=False), spring])


@pytest.mark.parametrize(
    ("laws", "named", "share", "joints"),
    [(4, True, 0.8, [1]), (3, True, 0.8, []), (4, False, 0.8, []), (4, True, 0.99, [])],
)
def test_many_laws_at_a_joint_with_a_name_are_none_unless_one_all_but_explains_it(
    prepared, laws, named, share, joints
):
    effects = ("torque_gain_error", "load_dependent_friction", "stribeck_friction", "transmission_ripple")
    taken_in = [
        accepted_of(next(c for c in candidates(prepared, only=[name]) if c.family.joint == 1), named=False)
        for name in effects[:laws]
    ]
    taken_in[0] = replace(taken_in[0], named=named, share=share)
    first = Stage.of(ground(prepared), [])
    found = many_laws(first, first, taken_in)
    assert [each.joint for each in found] == joints
    assert all(each.regime == MANY for each in found)


@pytest.mark.parametrize(
    ("shares", "named", "joints"),
    [((0.94, 0.9), True, []), ((0.94, 0.7), True, [1]), ((0.94, 0.9), False, [1])],
)
def test_two_laws_with_names_that_all_but_explain_a_joint_have_the_others_as_rests(
    prepared, shares, named, joints
):
    effects = ("torque_gain_error", "load_dependent_friction", "stribeck_friction", "transmission_ripple")
    every = [candidates(prepared, only=[name]) for name in effects]
    taken_in = [
        replace(accepted_of(next(c for c in each if c.family.joint == 1), named=own), share=share)
        for each, share, own in zip(every, (*shares, 0.2, 0.1), (True, named, False, False), strict=True)
    ]
    first = Stage.of(ground(prepared), [])
    assert [each.joint for each in many_laws(first, first, taken_in)] == joints


@pytest.mark.parametrize(("elsewhere", "joints"), [(0, [1]), (1, [])])
def test_imperfections_that_other_joints_have_as_many_of_are_no_law_without_a_name(
    prepared, elsewhere, joints
):
    effects = ("torque_gain_error", "load_dependent_friction", "stribeck_friction", "transmission_ripple")
    every = [candidates(prepared, only=[name]) for name in effects]
    taken_in = [accepted_of(next(c for c in each if c.family.joint == 1)) for each in every]
    others = [accepted_of(next(c for c in each if c.family.joint == 0), named=False) for each in every[3:]]
    first = Stage.of(ground(prepared), [])
    found = many_laws(first, first, [*taken_in, *others[:elsewhere]])
    assert [each.joint for each in found] == joints


@pytest.mark.parametrize(("named", "joints"), [(True, [1]), (False, [])])
def test_a_coupling_without_a_name_is_no_law_of_its_other_joint(prepared, named, joints):
    effects = ("torque_gain_error", "load_dependent_friction", "stribeck_friction", "joint_coupling")
    one, two, three, (coupling, *_) = (candidates(prepared, only=[name]) for name in effects)
    own = [next(c for c in each if c.family.joint == 1) for each in (one, two, three)]
    assert (coupling.family.joint, coupling.family.into) == (0, 1)
    taken_in = [*(accepted_of(each) for each in own), accepted_of(coupling, named=named)]
    first = Stage.of(ground(prepared), [])
    assert [each.joint for each in many_laws(first, first, taken_in)] == joints


@pytest.mark.parametrize(("count", "joints"), [(3, []), (4, [0, 1, 2])])
def test_many_couplings_are_no_drives(tmp_path, count, joints):
    scara = small_arm(tmp_path, SCARA)
    prepared = prepare(scara, simulated_runs(scara, [], runs=1))
    coupling = candidates(prepared, only=["joint_coupling"])[0]
    pairs = [(0, 1), (1, 2), (0, 2), (2, 1)]
    taken_in = [
        accepted_of(replace(coupling, family=replace(coupling.family, joint=joint, into=into)))
        for joint, into in pairs[:count]
    ]
    first = Stage.of(ground(prepared), [])
    assert [each.joint for each in many_laws(first, first, taken_in)] == joints


@pytest.mark.parametrize(("relative", "expected"), [(0.1, []), (-0.48, [1])])
def test_a_gain_error_that_no_drive_has_is_none(arm, prepared, relative, expected):
    gain = next(c for c in candidates(prepared, only=["torque_gain_error"]) if c.family.joint == 1)
    hypothesis, fitted = fitted_to(prepared, [gain])
    # The column is the reported torque: what is reported is that of the joint over one and the error.
    values = np.append(fitted.values[:-1], 1 / (1 + relative) - 1)
    found = out_of_bounds(arm, hypothesis, replace(fitted, values=values), [accepted_of(gain)])
    assert [each.joint for each in found] == expected


def test_a_gear_that_hardly_drives_back_is_told_with_what_was_fitted_for_it(arm):
    faults = ("load_dependent_friction:shoulder:coefficient=0.2", "torque_gain_error:shoulder:relative=0.2")
    found = diagnose(arm, simulated_runs(arm, [parse_injection(arm, text) for text in faults], runs=3))
    assert found.verdict == "unknown"
    assert re.match(
        r"At shoulder \d+% of the gap follows the joint's load, more of it one way", found.sentence
    )
    reasons = {each.effect: each.reason for each in found.ranked if each.joint == 0}
    assert reasons["load_dependent_friction"] == "fitted, beside what no effect explains at its joint"
