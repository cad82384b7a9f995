"""How often a name is right, by how well its joint is explained with it."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis.data.preparation import prepare
from diagnosis.decision.findings import Gap, NamedEffect
from diagnosis.decision.probability import DEVIATIONS, DOUBTFUL, LEFT, NAMED, certainties
from diagnosis.model.candidates import candidates
from diagnosis.report.sentence import sentence_of
from testbench.effects.signature import Quantity

from ...diagnosed import simulated_runs

ELBOW = 1


@pytest.fixture(scope="module")
def named(arm):
    """Two springs of the elbow that are known well."""
    own = candidates(prepare(arm, simulated_runs(arm, [], runs=1)), only=["cable_spring"])
    spring = next(c for c in own if c.family.joint == ELBOW)
    size = {"stiffness": Quantity(2.0, 0.01, "N·m/rad"), "rest": Quantity(0.1, 0.5, "rad")}
    return [NamedEffect("cable_spring", ELBOW, None, 1.0, size, spring)] * 2


def _gap(left):
    """So many times the floor is left at the elbow, and next to nothing elsewhere."""
    floor = np.ones(2)
    return Gap(5 * floor, np.array([2.0, 4.0]), np.array([1.0, left]), floor)


def _known_to(named, deviations):
    """The same, with sizes so many deviations from none."""
    size = {"stiffness": Quantity(2.0, 2.0 / deviations, "N·m/rad")}
    return [replace(each, parameters=each.parameters | size) for each in named]


def test_the_likelier_of_two_names_is_the_surer_one(named):
    assert certainties(named, _gap(left=1.0), runs=2) == NAMED
    third = certainties([*named, named[0]], _gap(left=1.0), runs=2)[2]
    assert third == NAMED[1]


@pytest.mark.parametrize(
    ("deviations", "left", "runs", "expected"),
    [
        (0.9 * DEVIATIONS, 1.1 * LEFT, 3, DOUBTFUL),
        # A size that is known, or a joint that is explained, is enough.
        (1.1 * DEVIATIONS, 1.1 * LEFT, 3, NAMED),
        (3.0, 0.9 * LEFT, 3, NAMED),
        # But parts of one run tell less of each other than runs do.
        (1.1 * DEVIATIONS, 0.9 * LEFT, 1, DOUBTFUL),
    ],
)
def test_a_name_is_doubtful_where_what_is_left_may_be_all_of_it(named, deviations, left, runs, expected):
    assert certainties(_known_to(named, deviations), _gap(left), runs) == expected


@pytest.mark.parametrize(("pitch", "expected"), [(0.03, NAMED), (0.01, DOUBTFUL)])
def test_what_has_no_joint_is_judged_where_most_is_to_explain_and_by_its_largest_size(named, pitch, expected):
    size = {"roll": Quantity(0.0, 0.001, "rad"), "pitch": Quantity(pitch, 0.001, "rad")}
    tilt = replace(named[0], effect="base_tilt", joint=None, parameters=size)
    assert certainties([tilt], _gap(left=1.1 * LEFT), runs=3) == expected[:1]


def test_rivals_share_what_a_name_has(named):
    rivalled = [replace(each, probability=0.6) for each in named]
    assert certainties(rivalled, _gap(left=1.0), 3) == pytest.approx([0.6 * level for level in NAMED])


@pytest.mark.parametrize(
    ("probability", "alike", "told"),
    [
        (0.93, ("gravity_spring",), "cable spring at elbow, cable spring at elbow;"),
        (0.55, (), "cable spring at elbow, perhaps cable spring at elbow;"),
        (0.45, ("gravity_spring",), "cable spring at elbow, cable spring or gravity spring at elbow;"),
    ],
)
def test_the_sentence_says_what_is_as_likely_as_not(arm, named, probability, alike, told):
    first, second = named[0], replace(named[1], probability=probability, confusable_with=alike)
    sentence = sentence_of(arm, "effect", [first, second], (), _gap(left=1.0), np.full(arm.joints, 10.0))
    assert sentence.startswith(f"The gap comes from {told}")
