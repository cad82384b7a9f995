"""Effects that predict left-out runs far worse than none."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis.data.preparation import prepare
from diagnosis.decision.attribution import Attribution
from diagnosis.decision.harmful_effects import without_misleading
from diagnosis.fit.normal_equations import fitted_to, on_whole_runs, squares
from diagnosis.model.base_regressor import BaseRegressor
from diagnosis.model.candidates import candidates
from diagnosis.plausibility.accepted import Accepted

from ...diagnosed import simulated_runs


@pytest.fixture(scope="module")
def prepared(arm):
    return prepare(arm, simulated_runs(arm, [], runs=2, noise=0.05))


def _accepted(prepared, effect, in_first_run):
    """A candidate of the second joint, of random columns: of the first run so much, of the second all."""
    own = next(c for c in candidates(prepared, only=[effect]) if c.family.joint == 1)
    random, sizes = np.random.default_rng(len(effect)), (in_first_run, 1.0)
    columns = [size * random.normal(size=run.shape) for size, run in zip(sizes, own.filtered, strict=True)]
    return replace(own, filtered=tuple(columns))


def _attribution(prepared, *effects):
    taken_in = tuple(
        Accepted(each, probability=1.0, rivals=(), score=100.0, share=0.8, worth=0.01) for each in effects
    )
    first = fitted_to(BaseRegressor(prepared), [])
    return Attribution(prepared, taken_in, *fitted_to(BaseRegressor(prepared), effects), first, (), (), ())


@pytest.mark.parametrize(("in_first_run", "kept"), [(1e-3, 0), (0.5, 1)])
def test_what_another_run_cannot_tell_is_taken_out(prepared, in_first_run, kept):
    found = _attribution(prepared, _accepted(prepared, "asymmetric_friction", in_first_run))
    only = found.parameters_only[0], on_whole_runs(*found.parameters_only)
    left, (_, final) = without_misleading(found, only)
    assert len(left.accepted) == len(left.hypothesis.accepted) == kept
    assert np.all(squares(final.held_out) < 2 * squares(only[1].held_out))


def test_what_misleads_is_taken_out_alone(prepared):
    good, bad = _accepted(prepared, "cable_spring", 0.5), _accepted(prepared, "gravity_spring", 1e-3)
    found = _attribution(prepared, good, bad)
    only = found.parameters_only[0], on_whole_runs(*found.parameters_only)
    left, _ = without_misleading(found, only)
    assert [each.candidate.family.effect for each in left.accepted] == ["cable_spring"]
