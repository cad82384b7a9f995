"""A hose with slack pulls one way: near a cable, but in no catalogue."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis.diagnose import diagnose
from diagnosis.proposals.one_sided_springs import ONE_SIDED
from testbench.effects import parse_injection

from ...diagnosed import simulated_runs

ELBOW = 1


def _hose(arm, stiffness, begins):
    """Runs of an arm whose elbow is pulled back beyond a position."""
    runs = {}
    for name, run in simulated_runs(arm, [], runs=3).items():
        torque = run.torque.copy()
        torque[:, ELBOW] += stiffness * np.maximum(run.position[:, ELBOW] - begins, 0.0)
        runs[name] = replace(run, torque=torque)
    return runs


@pytest.mark.parametrize("begins", [-0.3, 0.2])
def test_a_spring_that_pulls_one_way_is_told_as_such(arm, begins):
    found = diagnose(arm, _hose(arm, 6.0, begins))
    assert (found.verdict, found.effects, found.where[0].joint) == ("unknown", (), ELBOW)
    assert f"follows {ONE_SIDED}" in found.sentence
    assert found.sentence.endswith("a hose with slack or a bumper would.")


@pytest.mark.parametrize(
    "law", ["stiffness=3.0,rest=0.4", "stiffness=3.0,rest=0.4,doubling=1.0,law=hardening"]
)
def test_a_cable_that_pulls_both_ways_keeps_its_name(arm, law):
    found = diagnose(arm, simulated_runs(arm, [parse_injection(arm, f"cable_spring:elbow:{law}")], runs=3))
    assert [(each.effect, each.joint) for each in found.effects] == [("cable_spring", ELBOW)]
