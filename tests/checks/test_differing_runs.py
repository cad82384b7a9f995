"""Runs that differ: which, by what, and how much."""

from dataclasses import replace

import numpy as np

from recordings.checks.differing_runs import differences
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
