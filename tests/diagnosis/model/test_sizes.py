"""How near the parameters of a named effect come to those that acted: laws of several shapes, springs."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis.diagnose import diagnose
from identification.filtering import central_difference
from testbench.effects import parse_injection

from ...diagnosed import simulated_runs


@pytest.mark.parametrize("exponent", [1.3, 2.7])
def test_falling_friction_is_found_with_its_shape(arm, exponent):
    true = {"extra": 1.5, "velocity": 0.3, "exponent": exponent}
    text = ",".join(f"{name}={value}" for name, value in true.items())
    runs = simulated_runs(arm, [parse_injection(arm, f"stribeck_friction:shoulder:{text}")], runs=3)
    (found,) = diagnose(arm, runs).effects
    assert (found.effect, found.joint) == ("stribeck_friction", 0)
    for name, value in true.items():
        quantity = found.parameters[name]
        assert abs(quantity.value - value) < 4 * quantity.std
        assert 0 < quantity.std < 0.05 * value


@pytest.mark.parametrize(("coefficient", "exponent"), [(4.0, 0.4), (2.0, 0.7)])
def test_friction_that_bends_is_found_with_its_exponent(arm, coefficient, exponent):
    text = f"nonlinear_viscous_friction:shoulder:coefficient={coefficient},exponent={exponent}"
    (found,) = diagnose(arm, simulated_runs(arm, [parse_injection(arm, text)], runs=3)).effects
    assert (found.effect, found.joint) == ("nonlinear_viscous_friction", 0)
    for name, value in (("coefficient", coefficient), ("exponent", exponent)):
        quantity = found.parameters[name]
        assert abs(quantity.value - value) < 4 * quantity.std


@pytest.mark.parametrize("width", [0.02, 0.12])
def test_a_shared_drives_viscous_friction_is_none_of_its_coulomb_frictions_softness(arm, width):
    """fc tanh(v / w) on the sum of two speeds, added to the torque of runs without a fault."""
    true, runs = {"viscous": 0.3, "coulomb": 3.0}, simulated_runs(arm, [], runs=3)
    for name, run in runs.items():
        speed = central_difference(run.position, run.sample_rate).sum(axis=1, keepdims=True)
        shared = true["viscous"] * speed + true["coulomb"] * np.tanh(speed / width)
        runs[name] = replace(run, torque=run.torque + shared)
    (found,) = diagnose(arm, runs).effects
    assert (found.effect, found.joint, found.into) == ("joint_coupling", 0, 1)
    for name, value in true.items():
        quantity = found.parameters[name]
        assert abs(quantity.value - value) < 4 * quantity.std
        assert quantity.std < 0.05 * value


@pytest.mark.parametrize("stiffness", [700.0, 2500.0])
def test_the_stiffness_of_a_transmission_is_sought_at_the_load_that_it_leaves(arm, stiffness):
    text = f"joint_elasticity:shoulder:stiffness={stiffness},damping=4"
    (found,) = diagnose(arm, simulated_runs(arm, [parse_injection(arm, text)], runs=3)).effects
    assert (found.effect, found.joint) == ("joint_elasticity", 0)
    assert found.parameters["stiffness"].value == pytest.approx(stiffness, rel=0.02)
    damping = found.parameters["damping"]
    assert abs(damping.value - 4) < 4 * damping.std
    assert 0 < damping.std < 0.1 * 4


def test_a_spring_is_found_by_a_column_that_is_its_own(arm):
    """A little of what a far softer one's resonance does looks like it, and so does one that hardens."""
    stiffness = 3000.0
    text = f"joint_elasticity:shoulder:stiffness={stiffness},damping=4"
    (found,) = diagnose(arm, simulated_runs(arm, [parse_injection(arm, text)], runs=3)).effects
    assert (found.effect, found.joint, found.candidate.member.law) == ("joint_elasticity", 0, None)
    assert abs(found.parameters["stiffness"].value - stiffness) < 4 * found.parameters["stiffness"].std
    assert found.parameters["stiffness"].std < 0.02 * stiffness


@pytest.mark.parametrize("gap", [0.0011, 0.003, 0.009])
def test_a_play_is_found_by_when_the_link_lands_and_by_how_hard(arm, gap):
    runs = simulated_runs(arm, [parse_injection(arm, f"backlash:shoulder:gap={gap}")], runs=3)
    (found,) = diagnose(arm, runs).effects
    assert (found.effect, found.joint) == ("backlash", 0)
    assert found.parameters["gap"].value == pytest.approx(gap, rel=0.1)
