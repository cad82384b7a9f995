"""What several joints of a robot show alike is how its joints are, and no one joint's effect."""

import pytest

from diagnosis.diagnose import diagnose
from diagnosis.report.words import everywhere
from testbench.effects import parse_injection
from testbench.robot import Robot

from .diagnosed import simulated_runs
from .small_arm import SCARA, small_arm

# N·m·s²/rad² (N·s²/m²) that bend each joint's friction about as much, by its own torque.
BENT = {"turn": 1.2, "fold": 0.45, "lift": 90.0}


@pytest.fixture(scope="module")
def scara(tmp_path_factory: pytest.TempPathFactory) -> Robot:
    return small_arm(tmp_path_factory.mktemp("scara"), SCARA)


@pytest.mark.parametrize(("bent", "named"), [(("fold",), [1]), (("turn", "fold", "lift"), [])])
def test_friction_that_bends_at_all_joints_alike_is_no_joints_effect(scara, bent, named):
    faults = [
        parse_injection(scara, f"nonlinear_viscous_friction:{j}:coefficient={BENT[j]},exponent=2")
        for j in bent
    ]
    found = diagnose(scara, simulated_runs(scara, faults, runs=3))
    assert [each.joint for each in found.effects] == named
    assert bool(everywhere(found)) == (len(bent) > 1)
    assert {name for name, _ in found.everywhere} <= {"nonlinear_viscous_friction", "stribeck_friction"}
    if len(bent) > 1:
        assert found.verdict == "parameters"
