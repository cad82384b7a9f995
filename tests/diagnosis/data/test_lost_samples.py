"""Samples that a late or a bad packet spoils are distinguished from all that an arm does, and mended."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from diagnosis.data.preparation import prepare
from diagnosis.search.growth import attribute
from identification.pipeline import IdentificationOptions
from testbench.findings import headline
from testbench.jobs.identify import identify_recordings
from testbench.log import Recording
from testbench.lost_samples import lost_samples, mended
from testbench.robot import Robot
from testbench.sampling import on_grid
from testbench.time_stamps import as_sampled

from ...diagnosed import measured_only, simulated_runs


@pytest.fixture(scope="module")
def runs(arm: Robot) -> dict[str, Recording]:
    return simulated_runs(arm, [], runs=3, noise=0.01)


def held(run: Recording, seed: int) -> tuple[Recording, np.ndarray]:
    """The run with one sample in 200, and now and then three in a row, that are the one before again."""
    rng = np.random.default_rng(seed)
    places = np.flatnonzero(rng.random(len(run.time)) < 0.005)
    places = np.concatenate([places, places[::6] + 1, places[::6] + 2])
    places = np.unique(places[(places > 2) & (places < len(run.time) - 3)])
    position, torque = run.position.copy(), run.torque.copy()
    for k in places:
        position[k], torque[k] = position[k - 1], torque[k - 1]
    return replace(run, position=position, torque=torque), places


def spoiled(run: Recording, seed: int) -> tuple[Recording, np.ndarray]:
    """The run with twelve samples of the first joint's position 5 mrad off, either way."""
    rng = np.random.default_rng(seed)
    places = np.sort(rng.choice(np.arange(20, len(run.time) - 20, 15), 12, replace=False))
    position = run.position.copy()
    position[places, 0] += rng.choice([-0.005, 0.005], len(places))
    return replace(run, position=position), places


def unfilled(run: Recording, seed: int) -> tuple[Recording, np.ndarray]:
    """The run cut off while all joints move, with its last one to three records empty."""
    moving = np.all(np.abs(np.gradient(run.position, run.time, axis=0)) > 0.1, axis=1)
    end = int(np.flatnonzero(moving)[-1]) + 1
    places = np.arange(end - 1 - seed % 3, end)
    position, torque = run.position[:end].copy(), run.torque[:end].copy()
    position[places], torque[places] = 0.0, 0.0
    return replace(run, time=run.time[:end], position=position, torque=torque), places


def test_nothing_of_a_good_log_is_lost(runs):
    for run in runs.values():
        lost = lost_samples(run)
        assert not lost.any()
        whole = mended(run, lost)
        assert whole.position is run.position
        assert whole.torque is run.torque


@pytest.mark.parametrize("spoil", [held, spoiled])
def test_exactly_what_was_lost_is_found_and_is_a_cubic_again(runs, spoil):
    for seed, run in enumerate(runs.values()):
        bad, places = spoil(run, seed)
        lost = lost_samples(bad)
        assert np.flatnonzero(lost).tolist() == places.tolist()
        # Three samples in a row at 1 kHz: a cubic through the rest is as good as the encoder's 18 bits.
        assert np.allclose(mended(bad, lost).position, run.position, atol=3 * 2 * np.pi / 2**18)


@pytest.mark.parametrize("spoil", [held, spoiled])
def test_a_healthy_robot_has_no_effect_for_it(arm, runs, spoil):
    prepared = prepare(arm, {name: spoil(run, 7)[0] for name, run in runs.items()})
    assert all(run.lost > 5 for run in prepared.runs)
    found = attribute(prepared)
    assert not [a.candidate.family.effect for a in found.accepted if a.named]
    assert found.unknown == ()


def test_identification_mends_them_and_says_so(arm, runs):
    bad = {name: held(run, 7)[0] for name, run in runs.items()}
    options = IdentificationOptions()
    good, mended_ = (identify_recordings(arm, each, {}, options) for each in (runs, bad))
    assert good.mended == 0
    assert mended_.mended > 50
    assert f"{mended_.mended} samples" in headline(mended_)
    away = np.abs(mended_.estimate.values - good.estimate.values) / good.estimate.std
    assert away.max() < 1.0


def test_a_rest_is_not_lost(runs):
    run = runs["run_1"]
    position, torque = run.position.copy(), run.torque.copy()
    position[:200], torque[:200] = position[0], torque[0]
    assert not lost_samples(replace(run, position=position, torque=torque))[:190].any()


def test_all_channels_of_a_log_with_straying_stamps_are_kept(runs):
    run = runs["run_1"]
    kept = np.delete(np.arange(len(run.time)), [500, 501, 900])
    fields = ("time", "position", "torque", "reference_position", "reference_velocity")
    thinner = replace(
        run,
        velocity=None,
        torque_command=None,
        reference_acceleration=None,
        **{field: getattr(run, field)[kept] for field in fields},
    )
    even = on_grid(thinner)
    assert np.ptp(np.diff(even.time)) < 1e-9
    count = len(even.time)
    assert np.allclose(even.reference_velocity, run.reference_velocity[:count], atol=1e-3)
    assert np.allclose(even.reference_position, run.reference_position[:count], atol=1e-6)


@pytest.mark.parametrize("since", [0.0, 1.7e9])
def test_a_grid_does_not_drift_where_time_is_counted_from_1970(runs, since):
    run = runs["run_1"]
    rng = np.random.default_rng(2)
    time = since + run.time + rng.uniform(-0.2, 0.2, len(run.time)) / run.sample_rate
    even = on_grid(replace(run, time=time))
    assert len(even.time) >= len(run.time) - 2
    assert abs(even.time[-1] - even.time[0] - (len(even.time) - 1) / run.sample_rate) < 1e-6
    assert on_grid(even) is even
    assert even.torque_command is not None
    assert even.torque_command.shape == even.position.shape


def test_stamps_that_jitter_on_even_samples_are_those_of_a_grid(runs):
    run = runs["run_1"]
    rng = np.random.default_rng(3)
    jitter = rng.uniform(-0.4, 0.4, len(run.time)) / run.sample_rate
    kept = np.delete(np.arange(len(run.time)), [500, 501, 900])
    even = on_grid(replace(run, time=run.time + jitter))
    assert np.array_equal(even.position, run.position)
    # Samples that were taken as stamped are off the grid.
    spline = CubicSpline(run.time, run.position)
    as_stamped = replace(run, time=run.time + jitter, position=spline(run.time + jitter))
    assert as_sampled(as_stamped) is as_stamped
    # Small jitter leaves no doubt where some are missing.
    missing = replace(
        measured_only(run), **{f: getattr(run, f)[kept] for f in ("time", "position", "torque")}
    )
    steps = as_sampled(replace(missing, time=missing.time + 0.2 * jitter[kept])).time - run.time[kept]
    assert np.ptp(steps) < 1e-6


@pytest.mark.parametrize("field", ["position", "torque"])
def test_what_a_slower_bus_repeats_is_taken_between_what_it_brings(runs, field):
    # Noise, which a slow bus does not show between its samples, is another matter.
    run = replace(runs["run_1"], torque=10 * runs["run_1"].position)
    fresh = np.arange(len(run.time)) // 10 * 10
    slow = replace(run, **{field: getattr(run, field)[fresh]})
    assert not lost_samples(slow).any()
    between = mended(slow, lost_samples(slow))
    off, repeated = (
        np.sqrt(np.mean((getattr(each, field) - getattr(run, field))[:-20] ** 2)) for each in (between, slow)
    )
    # Lines are off by curvature, a cubic by next to nothing.
    assert off < {"position": 0.05, "torque": 0.25}[field] * repeated


@pytest.mark.parametrize("times", [4, 8])
def test_a_reader_faster_than_the_robot_tells_as_much(arm, runs, times):
    """Every sample of a 100 Hz robot some times over: nothing of it is lost."""
    fast = {}
    for name, run in runs.items():
        kept = {
            field: np.repeat(getattr(run, field)[::10], times, axis=0) for field in ("position", "torque")
        }
        count = len(kept["position"])
        rate = run.sample_rate / 10 * times
        time = np.arange(count) / rate
        fast[name] = replace(measured_only(run), sample_rate=rate, time=time, **kept)
    prepared = prepare(arm, fast)
    assert np.mean([part.used.mean() for part in prepared.runs]) > 0.5
    found = attribute(prepared)
    assert not [a.candidate.family.effect for a in found.accepted if a.named]
    assert found.unknown == ()


def test_empty_records_at_an_end_are_found_and_tell_nothing_of_the_robot(arm, runs):
    spoiled_runs = {}
    for seed, (name, run) in enumerate(runs.items()):
        cut = measured_only(run)
        bad, places = unfilled(cut, seed)
        assert np.flatnonzero(lost_samples(bad)).tolist() == places.tolist()
        turned = replace(bad, position=bad.position[::-1], torque=bad.torque[::-1])
        assert np.flatnonzero(lost_samples(turned)).tolist() == list(range(len(places)))
        spoiled_runs[name] = bad
    found = attribute(prepare(arm, spoiled_runs))
    assert not [a.candidate.family.effect for a in found.accepted if a.named]
    assert found.unknown == ()
