"""What is worth a name."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis.data.preparation import prepare
from diagnosis.fit.likelihood import Weighed
from diagnosis.fit.score import Stage
from diagnosis.model.base_regressor import BaseRegressor
from diagnosis.model.candidates import candidates
from diagnosis.plausibility.materiality import is_material
from diagnosis.search.growth import attribute
from testbench.effects import parse_injection

from ...diagnosed import measured_only, simulated_runs
from ...small_arm import small_arm
from ..certain_gain import certain, healthy_stage, of_size, squares


def _weighed(arm, text, shape):
    """The stage without effects of runs with this fault, and the fault's own candidate there."""
    prepared = prepare(arm, simulated_runs(arm, [parse_injection(arm, text)], runs=3))
    stage = Stage.of(BaseRegressor(prepared), [])
    name = text.split(":")[0]
    own = [c for c in candidates(prepared, only=[name]) if c.family.joint == 0 and shape(c.member)]
    gains = [gain for c in own if (gain := stage.gain(c)) is not None]
    return stage, max(gains, key=lambda gain: gain.objective)


@pytest.mark.parametrize(
    ("torque", "left", "expected"), [(0.006, 0.12, True), (0.006, 0.08, False), (0.004, 0.5, False)]
)
def test_what_is_material_explains_a_share_of_the_rest_and_of_the_torque(tmp_path, torque, left, expected):
    arm = small_arm(tmp_path)
    stage, (own, _) = healthy_stage(arm, "stribeck_friction")
    # No larger than on a healthy robot: its size does not speak for it.
    gain = of_size(arm, stage, own, 0.5, torque, left)
    assert is_material(arm, stage, Weighed(gain, 60.0)) == expected


@pytest.mark.parametrize(
    ("times", "torque", "expected"), [(1.5, 0.006, True), (1.1, 0.006, False), (1.5, 0.004, False)]
)
def test_what_is_certainly_larger_than_on_a_healthy_robot_is_material(tmp_path, times, torque, expected):
    arm = small_arm(tmp_path)
    stage, (own, _) = healthy_stage(arm, "stribeck_friction")
    # Little of what is left, and known to a twentieth: three deviations are 15 %.
    gain = of_size(arm, stage, own, times, torque, 0.02)
    assert is_material(arm, stage, Weighed(gain, 60.0)) == expected


@pytest.mark.parametrize(("overlap", "expected"), [(0.99, True), (0.5, False)])
def test_what_parameters_absorb_shows_at_the_joints_below(tmp_path, overlap, expected):
    arm = small_arm(tmp_path)
    stage, (_, own) = healthy_stage(arm, "torque_gain_error")
    below = np.array([1.0, 0.0]) * squares(stage, 0.01)
    stage.held_squares = np.maximum(stage.held_squares, 5 * below)
    gain = replace(certain(stage, own, 1e-6, below), overlap=overlap, prior=stage.prior)
    assert is_material(arm, stage, Weighed(gain, 60.0)) == expected


@pytest.mark.parametrize(
    ("name", "shift", "expected"),
    [
        ("torque_gain_error", 9.0, True),
        # A payload's ten coefficients gain as much by chance.
        ("payload", 9.0, False),
        ("payload", 17.0, True),
    ],
)
def test_a_shift_that_chance_spares_is_not_material(tmp_path, name, shift, expected):
    arm = small_arm(tmp_path)
    stage, _ = healthy_stage(arm, "cable_spring")
    gain = stage.gain(candidates(stage.prepared, only=[name])[0])
    assert gain is not None
    nothing = np.zeros(arm.joints)
    gain = replace(gain, overlap=0.99, prior=stage.prior + shift, held_out=nothing)
    assert is_material(arm, stage, Weighed(gain, 20.0)) == expected


@pytest.mark.parametrize(("score", "expected"), [(20.0, True), (-5.0, False)])
def test_what_costs_more_at_other_joints_than_it_explains_at_its_own_is_not_material(
    tmp_path, score, expected
):
    arm = small_arm(tmp_path)
    text = "transmission_ripple:shoulder:amplitude=3,cycles=12"
    stage, gain = _weighed(arm, text, lambda member: True)
    assert is_material(arm, stage, Weighed(gain, score)) == expected


@pytest.mark.parametrize(("seconds", "expected"), [(0.0038, []), (0.015, [("actuator_lag", 0)])])
def test_a_lag_of_more_than_a_sample_is_a_drives(tmp_path, seconds, expected):
    arm = small_arm(tmp_path)
    injection = parse_injection(arm, f"actuator_lag:shoulder:time_constant={seconds}")
    runs = simulated_runs(arm, [injection], runs=3)
    slow = {
        name: replace(
            measured_only(run),
            sample_rate=run.sample_rate / 10,
            time=run.time[::10],
            **{field: getattr(run, field)[::10] for field in ("position", "torque")},
        )
        for name, run in runs.items()
    }
    found = attribute(prepare(arm, slow))
    named = [(a.candidate.family.effect, a.candidate.family.joint) for a in found.accepted if a.named]
    assert named == expected


@pytest.mark.parametrize(("encoders", "expected"), [(0.4, True), (0.8, False)])
def test_an_elasticity_may_show_at_the_joints_that_bear_its_link_alone(tmp_path, encoders, expected):
    arm = small_arm(tmp_path)
    prepared = prepare(arm, simulated_runs(arm, [], runs=2))
    little = 0.01 * BaseRegressor(prepared).torque_rms
    stage = Stage.of(BaseRegressor(replace(prepared, encoder_torque=encoders * little)), [])
    own = next(c for c in candidates(stage.prepared, only=["joint_elasticity"]) if c.family.joint == 1)
    squared = np.array([1.0, 0.0]) * squares(stage, 0.01)
    known = replace(certain(stage, own, 0.4, squared), prior=stage.prior)
    stage.held_squares = np.maximum(stage.held_squares, 2 * squared)
    assert is_material(arm, stage, Weighed(known, 30.0)) == expected


@pytest.mark.parametrize(("delay", "expected"), [(0.004, True), (0.001, False)])
def test_torque_that_is_late_at_all_joints_is_a_delay_whatever_the_parameters_make_of_it(
    tmp_path, delay, expected
):
    arm = small_arm(tmp_path)
    late = parse_injection(arm, f"torque_delay::delay={delay}")
    prepared = prepare(arm, simulated_runs(arm, [late], runs=2))
    stage = Stage.of(BaseRegressor(prepared), [])
    gain = stage.gain(candidates(prepared, only=["torque_delay"])[0])
    against = replace(gain, prior=stage.prior - 0.5, held_out=squares(stage, 0.004))
    assert is_material(arm, stage, Weighed(against, 30.0)) == expected
