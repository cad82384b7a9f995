"""Which samples of a log count, and what is said where too few do."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis.data import mended_log, preparation
from diagnosis.data.preparation import REACH_PERIODS, prepare
from diagnosis.data.run import CUTOFF
from diagnosis.diagnose import diagnose
from diagnosis.model.base_regressor import BaseRegressor
from diagnosis.model.hypothesis import design
from diagnosis.report.summary import summary
from identification.band import Bands
from identification.errors import InputError
from testbench.effects import parse_injection
from testbench.log import Recording

from ...diagnosed import RATE, simulated_runs
from ...small_arm import small_arm

GAP = slice(3000, 3060)


def _without(run: Recording, missing: slice) -> Recording:
    """The log with some samples lost."""
    kept = np.delete(np.arange(len(run.time)), missing)
    channels = {
        name: None if values is None else values[kept]
        for name in ("velocity", "temperature", "torque_command", "reference_position")
        for values in [getattr(run, name)]
    }
    channels |= {"reference_velocity": None, "reference_acceleration": None}
    return replace(run, time=run.time[kept], position=run.position[kept], torque=run.torque[kept], **channels)


@pytest.mark.parametrize(("missing", "counts"), [(GAP, False), (slice(3000, 3003), True)])
def test_what_is_made_up_where_samples_are_missing_does_not_count(tmp_path, missing, counts):
    arm = small_arm(tmp_path)
    (log,) = simulated_runs(arm, [], runs=1).values()
    whole, short = (prepare(arm, {"run": each}).runs[0] for each in (log, _without(log, missing)))
    inside = (whole.kept >= missing.start - 10) & (whole.kept < missing.stop + 10)
    assert whole.used[inside].any()
    assert short.used[inside].any() == counts
    # What is far from it counts as before.
    away = np.abs(whole.kept - missing.start) > 200
    assert np.mean(short.used[away] == whole.used[away]) > 0.99


def test_long_logs_are_thinned_and_tell_the_same(tmp_path, monkeypatch):
    arm = small_arm(tmp_path)
    logs = simulated_runs(arm, [parse_injection(arm, "cable_spring:elbow:stiffness=3,rest=0.4")], runs=3)
    whole = diagnose(arm, logs)
    seconds = sum(len(each.time) for each in logs.values()) / RATE
    monkeypatch.setattr(mended_log, "MOST_LOGGED", 250 * seconds * arm.joints)
    monkeypatch.setattr(preparation, "MOST_KEPT", 30 * seconds * arm.joints)
    short = diagnose(arm, logs)
    assert short.prepared.runs[0].logged.sample_rate == 250.0
    assert len(short.prepared.runs[0].time) < 0.4 * len(whole.prepared.runs[0].time)
    # As many independent samples are in what is left.
    assert short.final[0].independent == pytest.approx(whole.final[0].independent, rel=0.1)
    (one,), (other,) = short.effects, whole.effects
    assert (one.effect, one.joint) == (other.effect, other.joint) == ("cable_spring", 1)
    for found in (one, other):
        stiffness = found.parameters["stiffness"]
        assert abs(stiffness.value - 3.0) < 4 * stiffness.std


def _held(arm, joints):
    """Two logs with some joints held where they begin, a little noise on everything."""
    rng, runs = np.random.default_rng(2), {}
    for name, run in simulated_runs(arm, []).items():
        position = run.position.copy()
        position[:, joints] = position[0, joints] + rng.normal(0, 1e-6, (len(position), len(joints)))
        runs[name] = replace(run, position=position, velocity=None)
    return runs


def test_logs_of_an_arm_at_rest_are_refused(tmp_path):
    arm = small_arm(tmp_path)
    with pytest.raises(InputError, match="hold no motion, got all at rest"):
        prepare(arm, _held(arm, [0, 1]))


def test_a_joint_that_stands_still_is_said_to_determine_nothing(tmp_path):
    arm = small_arm(tmp_path)
    found = diagnose(arm, _held(arm, [1]))
    assert found.prepared.still == {1}
    assert "elbow stood still: it stays as the model has it" in summary(found).plain
    assert all(each.joint != 1 for each in found.effects)


@pytest.mark.parametrize(("samples", "named"), [(1600, False), (2500, True)])
def test_what_explains_nearly_all_has_a_name_in_half_the_time(tmp_path, samples, named):
    arm = small_arm(tmp_path)
    coupling = parse_injection(arm, "joint_coupling:shoulder:into=elbow,viscous=4,coulomb=4")
    runs = simulated_runs(arm, [coupling], runs=1)
    found = diagnose(arm, {name: _without(run, slice(samples, None)) for name, run in runs.items()})
    assert not found.final[0].has_enough_samples.any()
    assert [(each.effect, each.joint) for each in found.effects] == [("joint_coupling", 0)] * named
    assert found.too_little_motion == (() if named else (0, 1))


def test_a_narrow_band_costs_independent_samples_once(tmp_path, monkeypatch):
    """All joints are decimated for the widest band, so that where all are narrow fewer samples are kept."""
    arm = small_arm(tmp_path)
    logs = simulated_runs(arm, [])
    wide = design(BaseRegressor(prepare(arm, logs)))
    bands = Bands(np.full(arm.joints, 0.4 * CUTOFF), np.zeros(arm.joints))
    monkeypatch.setattr(preparation, "joint_bands", lambda *_: bands)
    narrow = design(BaseRegressor(prepare(arm, logs)))
    kept = len(narrow.prepared.runs[0].time) / len(wide.prepared.runs[0].time)
    # Its longer filter reaches farther into the ends.
    assert kept == pytest.approx(0.4, rel=0.15)
    np.testing.assert_allclose(narrow.independent / narrow.counts, wide.independent / wide.counts)


@pytest.mark.parametrize(("doubtful", "beyond"), [(0.001, False), (0.1, True)])
def test_what_is_doubtful_for_long_is_smeared_beyond_half_a_period(tmp_path, doubtful, beyond):
    (run,) = prepare(small_arm(tmp_path), simulated_runs(small_arm(tmp_path), [], runs=1)).runs
    rate, reach = run.logged.sample_rate, REACH_PERIODS / CUTOFF
    is_doubtful = np.zeros(run.logged.samples, bool)
    first = run.logged.samples // 2
    is_doubtful[first : first + round(doubtful * rate)] = True
    step = run.filters[0].step / rate
    past = np.sum(~run.apart_from(is_doubtful, 0)) * step - doubtful
    assert past > 2 * reach - step
    assert (past > 2 * reach + step) == beyond
