"""Runs that differ: a tool in one of them, another day's offsets, a warm robot, a push."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis.data.preparation import prepare
from diagnosis.diagnose import diagnose
from diagnosis.held_out.difference import FRICTION, OFFSETS, PAYLOAD
from diagnosis.held_out.differing_runs import without_differences
from diagnosis.job import diagnose_logs
from diagnosis.report.notes import differences as in_words
from identification.errors import InputError
from testbench.effects import parse_injection
from testbench.robot import Robot

from ...diagnosed import simulated_runs
from ...small_arm import ARM, small_arm

MASS = 2.0
# Friction of two thirds.
WARM = ARM
for cold, warm in (("2", "1.3333333"), ("1", "0.6666667")):
    WARM = WARM.replace(f'frictionloss="{cold}"', f'frictionloss="{warm}"')
for cold, warm in (("3", "2"), ("1", "0.6666667")):
    WARM = WARM.replace(f'damping="{cold}"', f'damping="{warm}"')


@pytest.fixture
def arm(tmp_path) -> Robot:
    return small_arm(tmp_path)


@pytest.mark.parametrize("effects", [(), ("stribeck_friction:elbow:extra=1.0,velocity=0.1,exponent=1",)])
def test_a_tool_in_one_run_is_weighed_within_five_per_cent(arm, effects):
    injections = [parse_injection(arm, each) for each in effects]
    tool = parse_injection(
        arm, f"payload::mass={MASS},first_moment_x=0.1,first_moment_y=0.0,first_moment_z=0.05"
    )
    runs, loaded = simulated_runs(arm, injections, runs=3), simulated_runs(arm, [*injections, tool], runs=3)
    alike, (found,) = without_differences(prepare(arm, runs | {"run_2": loaded["run_2"]}))
    assert (found.run, found.kind) == ("run_2", PAYLOAD)
    assert found.mass is not None
    assert found.mass.value == pytest.approx(MASS, rel=0.05)
    empty = prepare(arm, runs).runs[1]
    left = alike.runs[1].torque - empty.torque
    assert np.sqrt(np.mean(left**2)) < 0.1 * np.sqrt(np.mean(empty.torque**2))
    assert in_words([found], arm)[0].startswith("run_2 carries ")


def test_a_tool_of_known_mass_tells_the_gains_of_the_drives(arm):
    gains = {"shoulder": -0.06, "elbow": 0.1}
    wrong = [parse_injection(arm, f"torque_gain_error:{name}:relative={e}") for name, e in gains.items()]
    tool = parse_injection(arm, f"payload::mass={MASS},first_moment_x=0.3,first_moment_z=0.1")
    empty, loaded = simulated_runs(arm, wrong, runs=3), simulated_runs(arm, [*wrong, tool], runs=3)
    runs = prepare(arm, empty | {"run_2": loaded["run_2"]})
    alike, (found,) = without_differences(runs, {"run_2": MASS})
    assert found.gains is not None
    assert found.deviations is not None
    np.testing.assert_allclose(found.gains, list(gains.values()), atol=0.03)
    assert np.all(np.abs(found.gains - list(gains.values())) < 4 * found.deviations)
    left = alike.runs[1].torque - prepare(arm, empty).runs[1].torque
    assert np.sqrt(np.mean(left**2)) < 0.05 * np.sqrt(np.mean(alike.runs[1].torque ** 2))
    said = in_words([found], arm)[0]
    assert said.startswith("By the 2 kg that run_2 carries, true over reported torque is shoulder 0.9")


TOOLS = {"run_2": 1.0, "run_3": 2.0, "run_5": 1.0, "run_6": 2.0}


@pytest.fixture
def loaded_runs(arm):
    """Six runs of one robot, of which four carry one of two tools."""
    runs = simulated_runs(arm, [], runs=6)
    for mass in (1.0, 2.0):
        tool = parse_injection(arm, f"payload::mass={mass},first_moment_x=0.1,first_moment_z=0.05")
        carried = simulated_runs(arm, [tool], runs=6)
        runs |= {name: carried[name] for name, own in TOOLS.items() if own == mass}
    return runs


def test_tools_in_most_of_the_runs_are_each_weighed(arm, loaded_runs):
    alike, found = without_differences(prepare(arm, loaded_runs))
    assert {each.run: each.kind for each in found} == dict.fromkeys(TOOLS, PAYLOAD)
    for each in found:
        assert each.mass is not None
        assert each.mass.value == pytest.approx(TOOLS[each.run], rel=0.05)
    assert without_differences(alike)[1] == ()
    (said,) = in_words(found, arm)
    assert said.startswith("run_2 carries ")
    assert ", run_6 " in said


def test_tools_of_known_masses_tell_the_gains_together(arm, loaded_runs):
    alike, found = without_differences(prepare(arm, loaded_runs), TOOLS)
    assert {each.run for each in found} == set(TOOLS)
    for each in found:
        assert each.gains is not None
        np.testing.assert_allclose(each.gains, 0.0, atol=0.01)
    assert without_differences(alike)[1] == ()
    (said,) = in_words(found, arm)
    assert said.startswith("By the 1 kg that run_2 carries and the 2 kg that run_3 carries and ")


@pytest.mark.parametrize("stated", ["run_9=2", "run_1", "run_1=heavy", "run_1=-2"])
def test_a_payload_that_is_stated_badly_is_refused(arm, tmp_path, stated):
    with pytest.raises(InputError, match="--payload"):
        diagnose_logs(arm.path, [tmp_path / "run_1.h5"], tmp_path / "out", payloads=[stated])


def test_another_days_offsets_are_found(arm):
    runs = simulated_runs(arm, [], runs=3)
    offsets = np.array([3.0, -1.5])
    runs["run_3"] = replace(runs["run_3"], torque=runs["run_3"].torque + offsets)
    _, (found,) = without_differences(prepare(arm, runs))
    assert (found.run, found.kind) == ("run_3", OFFSETS)
    np.testing.assert_allclose(found.offsets, offsets, rtol=0.1)
    assert "other offsets" in in_words([found], arm)[0]


@pytest.mark.parametrize("count", [2, 3])
def test_a_warm_run_among_cold_ones_is_found_by_its_friction(arm, tmp_path, count):
    (tmp_path / "warm").mkdir()
    warm = small_arm(tmp_path / "warm", WARM)
    runs = simulated_runs(arm, [], runs=count)
    runs["run_2"] = simulated_runs(warm, [], runs=count)["run_2"]
    alike, (found,) = without_differences(prepare(arm, runs))
    assert (found.run, found.kind) == ("run_2", FRICTION)
    assert found.friction is not None
    # Shoulder and elbow: of 3 and 1 N·m·s/rad, and of 2 and 1 N·m, a third less.
    np.testing.assert_allclose(found.friction, [[-1.0, -1 / 3], [-2 / 3, -1 / 3]], rtol=0.15)
    cold = prepare(arm, simulated_runs(arm, [], runs=count)).runs[1]
    left = alike.runs[1].torque - cold.torque
    assert np.sqrt(np.mean(left**2)) < 0.05 * np.sqrt(np.mean(cold.torque**2))
    assert "other friction" in in_words([found], arm)[0]


def test_a_push_in_one_run_is_named_as_of_that_run_and_hides_no_effect_of_all(arm):
    lasting = parse_injection(arm, "gravity_spring:shoulder:stiffness=8,phase=0.3")
    push = parse_injection(arm, "external_contact:elbow:torque=8,start=1.7,duration=0.4")
    runs = simulated_runs(arm, [lasting], runs=3)
    runs["run_2"] = simulated_runs(arm, [lasting, push], runs=3)["run_2"]
    found = {each.effect: each for each in diagnose(arm, runs).effects}
    assert set(found) == {"gravity_spring", "external_contact"}
    assert found["external_contact"].runs == (1,)
    assert found["gravity_spring"].runs == ()


EFFECTS_OF_ALL = [
    (),
    ("payload::mass=2,first_moment_x=0.1",),
    ("gravity_spring:elbow",),
    ("stribeck_friction:shoulder",),
    ("thermal_friction_drift:elbow",),
]


@pytest.mark.parametrize("effects", EFFECTS_OF_ALL)
def test_runs_of_one_robot_are_alike(arm, effects):
    injections = [parse_injection(arm, each) for each in effects]
    prepared = prepare(arm, simulated_runs(arm, injections, runs=3))
    assert without_differences(prepared) == (prepared, ())
