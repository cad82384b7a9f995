"""A dress pack that rubs: its hysteresis is part of the spring, and no effect of its own."""

import numpy as np
import pytest

from diagnosis.diagnose import diagnose
from testbench.effects import parse_injection

from ..diagnosed import simulated_runs

STIFFNESS, FRICTION, YIELDS = 3.0, 0.2, 0.1
CABLE = f"cable_spring:elbow:stiffness={STIFFNESS},rest=0.4"


@pytest.mark.parametrize("law", ["linear", "hysteretic"])
def test_a_cable_is_found_with_the_law_by_which_it_pulls(arm, law):
    found = diagnose(arm, simulated_runs(arm, [parse_injection(arm, f"{CABLE},law={law}")], runs=3))
    (cable,) = found.effects
    assert (cable.effect, cable.joint, cable.law) == ("cable_spring", 1, law)
    stiffness = cable.parameters["stiffness"]
    assert abs(stiffness.value - STIFFNESS) < 4 * stiffness.std
    if law == "hysteretic":
        shape = cable.candidate.member.shape
        assert shape == {
            "friction": pytest.approx(FRICTION, rel=0.1),
            "yields": pytest.approx(YIELDS, rel=0.2),
        }
        assert np.all(found.gap.effects < 1.1 * found.gap.noise_floor)


def test_a_cable_that_hardly_hardens_is_found_as_one(arm):
    text = "cable_spring:elbow:stiffness=3,rest=0.1,doubling=2.5,law=hardening"
    found = diagnose(arm, simulated_runs(arm, [parse_injection(arm, text)], runs=3))
    (cable,) = found.effects
    assert (cable.effect, cable.joint, cable.law) == ("cable_spring", 1, "hardening")
    for name, wanted in (("stiffness", 3.0), ("rest", 0.1), ("doubling", 2.5)):
        quantity = cable.parameters[name]
        assert abs(quantity.value - wanted) < 4 * quantity.std, name
