"""Runs that differ: which, by what, and how much."""

from dataclasses import replace

import numpy as np

from recordings.checks.differing_runs import check, differences
from recordings.checks.subject import Subject
from testbench.effects import parse_injection

from ..diagnosed import simulated_runs


def test_runs_of_one_robot_do_not_differ(arm, healthy_runs):
    assert differences(Subject(arm, healthy_runs)) == []


def test_a_payload_of_one_run_is_found_with_its_mass(arm, healthy_runs):
    loaded = simulated_runs(arm, [parse_injection(arm, "payload::mass=1.5,first_moment_x=0.15")], runs=3)
    runs = healthy_runs | {"run_2": loaded["run_2"]}
    (found,) = differences(Subject(arm, runs))
    assert (found.run, found.kind) == (1, "payload")
    assert abs(found.values[9] - 1.5) < max(0.2, 3 * found.deviations[9])


def test_other_friction_of_one_run_is_found(arm, healthy_runs):
    run = healthy_runs["run_3"]
    warmer = 1.0 * np.sign(np.gradient(run.position, run.time, axis=0))
    runs = healthy_runs | {"run_3": replace(run, torque=run.torque - warmer)}
    (found,) = differences(Subject(arm, runs))
    assert (found.run, found.kind) == (2, "friction")
    assert np.allclose(found.values[len(found.values) // 2 :], -1.0, atol=0.3)


def test_other_offsets_of_one_run_are_found(arm, healthy_runs):
    last = healthy_runs["run_3"]
    runs = healthy_runs | {"run_3": replace(last, torque=last.torque + np.array([3.0, -1.0]))}
    (found,) = differences(Subject(arm, runs))
    assert (found.run, found.kind) == (2, "offsets")
    assert np.allclose(found.values, [3.0, -1.0], atol=0.3)


def test_payloads_of_most_of_the_runs_are_found_with_their_masses(arm, healthy_runs):
    runs = dict(healthy_runs)
    for name, mass in (("run_2", 1.5), ("run_3", 3.0)):
        tool = parse_injection(arm, f"payload::mass={mass},first_moment_x={0.1 * mass}")
        runs[name] = simulated_runs(arm, [tool], runs=3)[name]
    found = differences(Subject(arm, runs))
    assert [(each.run, each.kind) for each in found] == [(1, "payload"), (2, "payload")]
    for each, mass in zip(found, (1.5, 3.0), strict=True):
        assert abs(each.values[9] - mass) < max(0.2, 3 * each.deviations[9])
    (said,) = [each.sentence for each in check(Subject(arm, runs)) if "carries" in each.sentence]
    assert said.startswith("run_2 carries ")
    assert ", run_3 " in said
