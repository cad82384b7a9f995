"""Runs that differ: a tool in one of them, another day's offsets."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis.data.preparation import prepare
from diagnosis.fit.linearisation import PAYLOAD
from diagnosis.held_out.differing_runs import OFFSETS, in_words, without_differences
from diagnosis.job import diagnose_logs
from identification.errors import InputError
from testbench.effects import parse_injection
from testbench.robot import Robot

from ...diagnosed import simulated_runs
from ...small_arm import small_arm

MASS = 2.0


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
    assert in_words([found], arm.joint_names, arm.units())[0].startswith("run_2 carries ")


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
    said = in_words([found], arm.joint_names, arm.units())[0]
    assert said.startswith("By the 2 kg that run_2 carries, true over reported torque is shoulder 0.9")


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
    assert "other offsets" in in_words([found], arm.joint_names, arm.units())[0]


@pytest.mark.parametrize("effects", [(), ("payload::mass=2,first_moment_x=0.1",), ("gravity_spring:elbow",)])
def test_runs_of_one_robot_are_alike(arm, effects):
    injections = [parse_injection(arm, each) for each in effects]
    prepared = prepare(arm, simulated_runs(arm, injections, runs=3))
    assert without_differences(prepared) == (prepared, ())
