"""The library of columns: they are made once for a load, whatever becomes known of friction."""

import numpy as np
import pytest

from diagnosis.data.preparation import prepare
from diagnosis.model.library import Library
from diagnosis.proposals.low_speed_friction import NearRest, with_friction_near_rest
from identification.parameters import COULOMB, MASS, PER_JOINT, VISCOUS
from testbench.effects import effects

from ...diagnosed import simulated_runs
from ...small_arm import small_arm


@pytest.fixture(scope="module")
def prepared(tmp_path_factory):
    arm = small_arm(tmp_path_factory.mktemp("arm"))
    return prepare(arm, simulated_runs(arm, [], runs=2, seed=5))


def _with_parameters(prepared, places, factor):
    """The runs with some of every joint's parameters changed."""
    table = prepared.nominal.reshape(-1, PER_JOINT).copy()
    table[:, places] *= factor
    nothing = [np.zeros_like(run.logged.tau) for run in prepared.runs]
    return prepared.linearised_at(table.ravel(), nothing, nothing, prepared.zeros)


def _by_another_friction(prepared):
    turned = with_friction_near_rest(prepared, NearRest({0: 0.05, 1: 0.08}))
    return _with_parameters(turned, [VISCOUS, COULOMB], 1.5)


def _places(candidates):
    return [(each.place, each.member.law, each.member.shape) for each in candidates]


def _alike(one, other):
    return all(np.array_equal(*pair) for pair in zip(one.filtered, other.filtered, strict=True))


def test_what_friction_is_in_is_made_again_and_all_is_as_if_made_anew(prepared):
    first, second = Library(()), Library(())
    first.along(prepared)
    old = {id(each) for each in first.catalogue}
    first.along(_by_another_friction(prepared))
    second.along(_by_another_friction(prepared))
    assert _places(first.catalogue) == _places(second.catalogue)
    # Every effect that does not say so is the same by any friction; or its description is wrong.
    assert all(_alike(*pair) for pair in zip(first.catalogue, second.catalogue, strict=True))
    assert all(_alike(*pair) for pair in zip(first.motions, second.motions, strict=True))
    again = {each.family.effect for each in first.catalogue if id(each) not in old}
    of_friction = {name for name, each in effects().items() if each.DESCRIPTION.of_friction}
    assert again == of_friction


def test_links_that_are_another_load_are_sought_anew(prepared):
    library = Library(())
    anew, heavier = Library(()), _with_parameters(prepared, [MASS], 1.5)
    library.along(prepared)
    old = library.catalogue
    library.along(heavier)
    anew.along(heavier)
    assert not {id(each) for each in old} & {id(each) for each in library.catalogue}
    # Free functions of the motion are kept, and must be what they would be there.
    assert all(_alike(*pair) for pair in zip(library.motions, anew.motions, strict=True))


def test_a_load_that_hardly_differs_keeps_the_columns(prepared):
    library = Library(())
    library.along(prepared)
    old = {each.place: each for each in library.catalogue}
    library.along(_with_parameters(prepared, [MASS], 1.001))
    kept = {each.family.effect for each in library.catalogue if any(each is o for o in old.values())}
    assert "joint_elasticity" in kept
