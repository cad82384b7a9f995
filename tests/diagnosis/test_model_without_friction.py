"""Models as URDFs give them: no friction, no damping, no rotors. What they leave out is no effect."""

import re

import numpy as np
import pytest

from diagnosis.data.preparation import prepare
from diagnosis.search.growth import attribute
from identification.parameters import ARMATURE, COULOMB, PER_JOINT, VISCOUS
from identification.prior import parameter_widths
from testbench.effects.base import Injection
from testbench.robot import Robot, load_robot

from ..diagnosed import simulated_runs


@pytest.fixture(scope="module")
def bare(arm: Robot) -> Robot:
    """The same arm, of a model that has links alone."""
    path = arm.path.with_name("links.xml")
    path.write_text(re.sub(r'\s(armature|damping|frictionloss)="[^"]*"', "", arm.path.read_text()))
    return load_robot(path)


def test_a_healthy_robot_has_no_effect_and_nothing_unknown(arm, bare):
    found = attribute(prepare(bare, simulated_runs(arm, [], runs=3)))
    assert not [a.candidate.family.effect for a in found.accepted if a.named]
    assert found.unknown == ()


@pytest.mark.parametrize(
    ("name", "parameters"),
    [
        ("cable_spring", {"stiffness": 3.0, "rest": 0.2}),
        ("stribeck_friction", {"extra": 0.8, "velocity": 0.4, "exponent": 2.0}),
        ("torque_gain_error", {"relative": 0.15}),
    ],
)
def test_an_effect_is_named_alone(arm, bare, name, parameters):
    joint = 0 if name == "torque_gain_error" else 1
    runs = simulated_runs(arm, [Injection(name, joint, parameters)], runs=3)
    found = attribute(prepare(bare, runs))
    named = [(a.candidate.family.effect, a.candidate.family.joint) for a in found.accepted if a.named]
    assert named == [(name, joint)]


def test_what_a_model_leaves_out_may_need_all_of_the_torque(arm):
    torque, speed, acceleration = np.array([30.0, 5.0]), np.array([1.0, 2.0]), np.array([4.0, 10.0])
    table = arm.parameters.reshape(-1, PER_JOINT).copy()
    table[1, [ARMATURE, VISCOUS, COULOMB]] = 0.0
    width = parameter_widths(table.ravel(), torque, speed, acceleration).reshape(-1, PER_JOINT)
    assert np.allclose(width[1, [ARMATURE, VISCOUS, COULOMB]], [0.5, 2.5, 5.0])
    assert np.all(width[0, [ARMATURE, VISCOUS, COULOMB]] < table[0, [ARMATURE, VISCOUS, COULOMB]])
