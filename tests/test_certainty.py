"""How often a name is right, by how well its joint is explained with it."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis.attribution import Attribution
from diagnosis.candidates import candidates
from diagnosis.certainty import DEVIATIONS, DOUBTFUL, LEFT, NAMED, certainty
from diagnosis.evidence import fitted_to
from diagnosis.findings import Gap
from diagnosis.preparation import prepare

from .accepted_effects import accepted_of
from .diagnosed import simulated_runs

ELBOW = 1


@pytest.fixture(scope="module")
def found(arm):
    """Two springs of the elbow, the second one likelier; the arm has none."""
    prepared = prepare(arm, simulated_runs(arm, [], runs=2, noise=0.05))
    names = ("cable_spring", "gravity_spring")
    springs = [
        next(c for c in candidates(prepared, only=[name]) if c.family.joint == ELBOW) for name in names
    ]
    first, second = (accepted_of(each) for each in springs)
    both = first, replace(second, score=2 * first.score)
    fit = fitted_to(prepared, springs)
    return Attribution(prepared, both, *fit, fitted_to(prepared, []), (), (), ())


def _gap(left):
    """So many times the floor is left at the elbow, and next to nothing elsewhere."""
    floor = np.ones(2)
    return Gap(5 * floor, 4 * floor, np.array([1.0, left]), floor)


def _of_size(found, deviations):
    """What was found, with both sizes so many deviations from none."""
    values = found.fitted.values.copy()
    for part in found.hypothesis.parts:
        values[part] = 0.0
        values[part.start] = deviations / np.sqrt(
            np.linalg.pinv(found.fitted.covariance[part, part], hermitian=True)[0, 0]
        )
    return replace(found, fitted=replace(found.fitted, values=values))


def test_the_likelier_of_two_names_is_the_surer_one(found):
    said = certainty(found, _gap(left=1.0))
    assert list(said.items()) == [(1, NAMED[0]), (0, NAMED[1])]


def test_a_name_is_doubtful_where_much_is_left_and_little_is_known_of_its_size(found):
    said = certainty(_of_size(found, 0.9 * DEVIATIONS), _gap(left=1.1 * LEFT))
    assert list(said.values()) == list(DOUBTFUL)


@pytest.mark.parametrize(("deviations", "left"), [(1.1 * DEVIATIONS, 1.1 * LEFT), (3.0, 0.9 * LEFT)])
def test_a_size_that_is_known_or_a_joint_that_is_explained_is_enough(found, deviations, left):
    assert list(certainty(_of_size(found, deviations), _gap(left)).values()) == list(NAMED)


def test_one_run_alone_tells_less(arm):
    prepared = prepare(arm, simulated_runs(arm, [], runs=1, noise=0.05))
    spring = next(c for c in candidates(prepared, only=["cable_spring"]) if c.family.joint == ELBOW)
    fit = fitted_to(prepared, [spring])
    alone = Attribution(prepared, (accepted_of(spring),), *fit, fitted_to(prepared, []), (), (), ())
    assert certainty(alone, _gap(left=1.0)) == {0: DOUBTFUL[0]}


def test_rivals_share_what_a_name_has(found):
    rivalled = tuple(replace(item, probability=0.6) for item in found.accepted)
    said = certainty(replace(found, accepted=rivalled), _gap(left=1.0))
    assert list(said.values()) == pytest.approx([0.6 * level for level in NAMED])


def test_what_has_no_name_has_no_probability(found):
    nameless = tuple(replace(item, named=False) for item in found.accepted)
    assert certainty(replace(found, accepted=nameless), _gap(left=1.0)) == {}
