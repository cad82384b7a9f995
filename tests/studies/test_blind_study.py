"""A small study of withheld effects with a fixed seed: what the diagnosis found, it goes on finding."""

import csv

import pytest

from studies.blind.study import study

from ..small_arm import ARM

SCENARIO = """
name: blind_regression
seed: 3
cases: {single: 5, pair: 0, triple: 0, none: 2, unknown: 2}
robots: [{model: arm.xml}]
least_moved: 0.02
runs: {fewest: 3, most: 3, shortest: 8 s, longest: 8 s, sample_rates: [500], physics_timestep: 0.0005}
"""


@pytest.fixture(scope="module")
def rows(tmp_path_factory):
    folder = tmp_path_factory.mktemp("study")
    (folder / "arm.xml").write_text(ARM)
    (folder / "scenario.yaml").write_text(SCENARIO)
    study(folder / "scenario.yaml", folder / "out", jobs=1)
    with (folder / "out" / "cases.csv").open() as file:
        return list(csv.DictReader(file))


def test_a_healthy_robot_raises_no_alarm(rows):
    healthy = [row for row in rows if row["kind"] == "none"]
    assert len(healthy) == 2
    assert all(row["verdict"] in ("none", "parameters") for row in healthy)


def test_no_wrong_name_is_given(rows):
    assert [row["case"] for row in rows if row["wrong"] == "True"] == []


def test_an_effect_outside_the_catalogue_is_reported_as_unknown(rows):
    outside = [row for row in rows if row["kind"] == "unknown"]
    assert [row["verdict"] for row in outside] == ["unknown", "unknown"]


def test_most_single_effects_are_named_first_at_their_joint(rows):
    singles = [row for row in rows if row["kind"] == "single"]
    # Of the other two one moves less than 3 % of the torque, and two joints determine little of a payload.
    assert sum(row["right"] == "True" for row in singles) >= 3
