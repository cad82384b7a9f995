"""Limits of drives and pushes: what makes a torque large without the motion showing it."""

import numpy as np
import pytest

from diagnosis.attribution import attribute
from diagnosis.materiality import quantities
from diagnosis.preparation import prepare
from testbench.effects import parse_injection
from tests.diagnosed import simulated_runs
from tests.small_arm import small_arm


@pytest.fixture(scope="module")
def arm(tmp_path_factory):
    return small_arm(tmp_path_factory.mktemp("arm"))


def _named(arm, runs):
    return [item for item in attribute(prepare(arm, runs)).accepted if item.named]


def _with_share_clipped(arm, share, law="clip"):
    torque = np.concatenate([run.torque for run in simulated_runs(arm, [], runs=3).values()])
    limit = float(np.quantile(np.abs(torque[:, 1]), 1 - share))
    text = f"torque_saturation:elbow:law={law},limit={limit}"
    return limit, simulated_runs(arm, [parse_injection(arm, text)], runs=3)


@pytest.mark.parametrize(
    ("share", "law", "tolerance"), [(0.05, "clip", 0.03), (0.02, "soft", 0.1), (0.5, "clip", 0.03)]
)
def test_a_limit_is_found_however_much_more_is_asked_for(arm, share, law, tolerance):
    limit, runs = _with_share_clipped(arm, share, law)
    first = _named(arm, runs)[0]
    assert first.candidate.place == ("torque_saturation", 1, None)
    found = quantities(first.candidate, np.ones(1))["limit"].value
    # A soft limit gives 92 % of itself where that is asked for.
    assert found == pytest.approx(limit, rel=tolerance)


def test_a_push_is_no_limit(arm):
    text = "external_contact:elbow:torque=6,start=3,duration=0.5"
    named = _named(arm, simulated_runs(arm, [parse_injection(arm, text)], runs=3))
    assert [item.candidate.place for item in named] == [("external_contact", 1, None)]


def test_a_healthy_arm_clips_nothing(arm):
    assert _named(arm, simulated_runs(arm, [], runs=3)) == []
