"""What several joints of a robot show alike is how its joints are, and no one joint's effect."""

from collections.abc import Mapping

import pytest

from diagnosis.diagnose import diagnose
from diagnosis.findings import Diagnosis
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


def _diagnosed(robot: Robot, text: str, values: Mapping[str, float]) -> Diagnosis:
    """Of a robot with this effect at some joints. values: by joint; none has it where that is zero."""
    faults = [parse_injection(robot, text.format(*each)) for each in values.items() if each[1] > 0]
    return diagnose(robot, simulated_runs(robot, faults, runs=3))


@pytest.mark.parametrize(("others", "named"), [(0.0, [1]), (0.4, [0, 1, 2]), (1.0, [])])
def test_friction_that_bends_hardly_more_than_at_other_joints_is_no_joints_effect(scara, others, named):
    # A joint that has far more is not among those that the others are held against.
    shares = {"turn": others, "fold": 1.0, "lift": others}
    bends = {joint: share * BENT[joint] for joint, share in shares.items()}
    found = _diagnosed(scara, "nonlinear_viscous_friction:{}:coefficient={},exponent=2", bends)
    assert sorted(each.joint for each in found.effects) == named
    assert bool(everywhere(found)) == (not named)
    assert {name for name, _ in found.everywhere} <= {"nonlinear_viscous_friction", "stribeck_friction"}
    if not named:
        assert found.verdict == "parameters"


@pytest.mark.parametrize(("others", "named"), [(0.0, [1]), (2.5, []), (0.7, [0, 1])])
def test_bristles_have_a_name_where_other_joints_have_none_or_they_are_all_that_is_left(scara, others, named):
    # N·m/rad, of bristles that give way with all of the joint's Coulomb friction.
    stiff = {"fold": 1500 if others > 1 else 1000, "turn": 2000 * others}
    found = _diagnosed(scara, "presliding_hysteresis:{}:stiffness={}", stiff)
    assert sorted(each.joint for each in found.effects) == named
    assert {each.effect for each in found.effects} <= {"presliding_hysteresis"}
