"""What left-out runs keep of a fit: never a larger error than before it."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from diagnosis.held_out.shrinkage import Kept, shares_kept

JOINTS, SAMPLES = 3, 60


def _residuals(seed: int, parameters: float, effects: float) -> tuple[list[np.ndarray], ...]:
    """Residuals of two runs by three models; a factor below one of the second and third is an improvement."""
    rng = np.random.default_rng(seed)
    given = [rng.standard_normal((SAMPLES, JOINTS)) for _ in range(2)]
    first = [parameters * run + 0.3 * rng.standard_normal(run.shape) for run in given]
    second = [effects * run + 0.3 * rng.standard_normal(run.shape) for run in first]
    return given, first, second


def _kept(*left_out: list[np.ndarray]) -> Kept:
    """What is kept where no sample is near rest."""
    at_rest = [[np.zeros_like(run) for run in runs] for runs in left_out]
    return shares_kept(left_out, at_rest, np.ones(JOINTS))[0]


def _squares(runs: list[np.ndarray]) -> np.ndarray:
    return np.sum(np.concatenate(runs) ** 2, axis=0)


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 10_000), st.floats(-30, 30), st.floats(-30, 30))
def test_what_is_kept_is_never_worse_on_runs_left_out(seed: int, parameters: float, effects: float) -> None:
    given_, first, second = _residuals(seed, parameters, effects)
    weights = np.array([1.0, 4.0, 0.25])
    at_rest = _residuals(seed + 1, effects, parameters)
    kept, _ = shares_kept((given_, first, second), at_rest, weights)
    resting = [kept.of_torque(*run, np.ones((SAMPLES, JOINTS), bool)) for run in zip(*at_rest, strict=True)]
    slowly, at_last = (list(each) for each in zip(*resting, strict=True))
    assert np.all(_squares(slowly) <= _squares(at_rest[0]) * (1 + 1e-12))
    assert np.all(_squares(at_last) <= _squares(slowly) * (1 + 1e-12))
    shrunk, final = zip(
        *(kept.of_torque(*run) for run in zip(given_, first, second, strict=True)), strict=True
    )
    assert np.all(_squares(shrunk) <= _squares(given_) * (1 + 1e-12))
    assert np.all(_squares(final) <= _squares(shrunk) * (1 + 1e-12))
    as_one = [g + kept.parameters_whole * (f - g) for g, f in zip(given_, first, strict=True)]
    assert weights @ _squares(as_one) <= weights @ _squares(given_) * (1 + 1e-12)


def test_a_fit_that_halves_the_error_is_kept_as_it_is() -> None:
    rng = np.random.default_rng(1)
    given_ = [rng.standard_normal((400, JOINTS))]
    kept = _kept(given_, [0.5 * given_[0]], [0.05 * given_[0]])
    np.testing.assert_array_equal(kept.parameters, np.ones(JOINTS))
    np.testing.assert_array_equal(kept.effects, np.ones(JOINTS))
    assert (kept.parameters_whole, kept.effects_whole) == (1.0, 1.0)


@pytest.mark.parametrize(("overshot", "share"), [(2.0, 0.5), (1.05, 1.0), (20.0, 0.0)])
def test_a_change_that_goes_too_far_is_kept_in_part(overshot: float, share: float) -> None:
    given_ = [np.random.default_rng(2).standard_normal((50, JOINTS))]
    kept = _kept(given_, [(1 - overshot) * given_[0]], [0.0 * given_[0]])
    np.testing.assert_allclose(kept.parameters, share)


def test_a_joint_of_which_no_sample_counts_stays_as_the_model_has_it() -> None:
    given_, first, second = _residuals(3, 0.1, 0.1)
    for runs in (given_, first, second):
        for run in runs:
            run[:, 1] = 0.0
    kept = _kept(given_, first, second)
    assert (kept.parameters[1], kept.effects[1]) == (0.0, 0.0)
    torque = np.arange(6.0).reshape(2, 3)
    _, final = kept.of_torque(torque, torque + 5, torque - 7)
    np.testing.assert_array_equal(final[:, 1], torque[:, 1])


def test_what_only_harms_near_rest_is_kept_while_the_joint_moves() -> None:
    given_ = [np.random.default_rng(5).standard_normal((80, JOINTS))]
    halved = [0.5 * given_[0]]
    harmed = [given_[0], given_[0], 4.0 * given_[0]]
    kept, better = shares_kept((given_, given_, halved), [[each] for each in harmed], np.ones(JOINTS))
    np.testing.assert_array_equal(kept.effects, np.ones(JOINTS))
    np.testing.assert_array_equal(kept.effects_at_rest, np.zeros(JOINTS))
    assert better.all()


def test_what_some_runs_speak_for_and_others_against_is_not_kept() -> None:
    rng = np.random.default_rng(6)
    runs = [rng.standard_normal((80, JOINTS)) for _ in range(4)]
    halves_or_doubles = [factor * run for factor, run in zip((0.3, 1.6, 0.4, 1.5), runs, strict=True)]
    assert np.all(_squares(halves_or_doubles[::2]) < _squares(runs[::2]))
    kept = _kept(runs, halves_or_doubles, halves_or_doubles)
    np.testing.assert_array_equal(kept.parameters, np.zeros(JOINTS))
