"""What is worth a name."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis.data.preparation import prepare
from diagnosis.fit.likelihood import Weighed
from diagnosis.fit.normal_equations import fitted_to
from diagnosis.fit.score import Stage
from diagnosis.model.base_regressor import ground
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
    stage = Stage(ground(prepared), *fitted_to(prepared, []))
    name = text.split(":")[0]
    own = [c for c in candidates(prepared, only=[name]) if c.family.joint == 0 and shape(c.member)]
    gains = [gain for c in own if (gain := stage.gain(c)) is not None]
    return stage, max(gains, key=lambda gain: gain.objective)


@pytest.mark.parametrize(
    ("torque", "left", "expected"), [(0.003, 0.45, True), (0.003, 0.35, False), (0.001, 0.45, False)]
)
def test_what_acts_near_rest_need_be_little_torque_where_it_is_much_of_what_is_left(
    tmp_path, torque, left, expected
):
    arm = small_arm(tmp_path)
    stage, (own, _) = healthy_stage(arm, "stribeck_friction")
    gain = of_size(arm, stage, own, 2.0, torque, left)
    assert is_material(arm, stage, Weighed(gain, 60.0)) == expected


@pytest.mark.parametrize(
    ("name", "shift", "expected"),
    [
        ("torque_gain_error", 9.0, True),
        # A payload's ten coefficients gain as much by chance.
        ("payload", 9.0, False),
        ("payload", 17.0, True),
        # Nor is a gravity spring more than the first moments of a few links that are not as drawn.
        ("gravity_spring", 9.0, False),
        ("gravity_spring", 13.0, True),
    ],
)
def test_a_shift_that_chance_or_a_few_links_spare_is_not_material(tmp_path, name, shift, expected):
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


@pytest.mark.parametrize(
    ("name", "amount", "encoders", "expected"),
    [
        ("asymmetric_friction", 0.4, 0.0, True),
        ("cable_spring", 0.4, 0.0, False),
        ("nonlinear_viscous_friction", 8.0, 0.0, True),
        ("nonlinear_viscous_friction", 0.4, 0.0, False),
        ("backlash", 10.0, 0.0, True),
        ("backlash", 10.0, 0.8, True),
        ("backlash", 0.4, 0.0, False),
        ("encoder_eccentricity", 0.018, 0.0, True),
        ("encoder_eccentricity", 0.008, 0.0, False),
        ("joint_elasticity", 0.4, 0.4, True),
        # Smoothing takes away what encoders seem to add.
        ("joint_elasticity", 0.4, 0.8, False),
    ],
)
def test_what_leaves_little_is_judged_by_its_size(tmp_path, name, amount, encoders, expected):
    arm = small_arm(tmp_path)
    prepared = prepare(arm, simulated_runs(arm, [], runs=2))
    little = 0.003 * ground(prepared).torque_rms
    stage = Stage.of(ground(replace(prepared, encoder_torque=encoders * little)), [])
    own = next(c for c in candidates(stage.prepared, only=[name]) if c.family.joint == 0)
    # It is certain, a seventh of the rest and .3 % of the torque.
    squared = np.array([1.0, 0.0]) * squares(stage, 0.003)
    known = replace(certain(stage, own, amount, squared), prior=stage.prior)
    stage.held_squares = np.maximum(stage.held_squares, 7 * squared)
    assert known.wald == pytest.approx(400)
    assert is_material(arm, stage, Weighed(known, 30.0)) == expected


@pytest.mark.parametrize(("encoders", "expected"), [(0.4, True), (0.8, False)])
def test_an_elasticity_may_show_at_the_joints_that_bear_its_link_alone(tmp_path, encoders, expected):
    arm = small_arm(tmp_path)
    prepared = prepare(arm, simulated_runs(arm, [], runs=2))
    little = 0.01 * ground(prepared).torque_rms
    stage = Stage.of(ground(replace(prepared, encoder_torque=encoders * little)), [])
    own = next(c for c in candidates(stage.prepared, only=["joint_elasticity"]) if c.family.joint == 1)
    squared = np.array([1.0, 0.0]) * squares(stage, 0.01)
    known = replace(certain(stage, own, 0.4, squared), prior=stage.prior)
    stage.held_squares = np.maximum(stage.held_squares, 2 * squared)
    assert is_material(arm, stage, Weighed(known, 30.0)) == expected


@pytest.mark.parametrize(
    ("name", "share", "amount", "expected"),
    [
        ("asymmetric_friction", 0.001, 0.1, False),
        ("asymmetric_friction", 0.001, 0.8, True),
        ("asymmetric_friction", 0.03, 0.1, True),
        ("cable_spring", 0.001, 0.1, True),
    ],
)
def test_a_small_offset_of_the_torque_that_shows_in_the_parameters_alone_may_be_the_sensors(
    tmp_path, name, share, amount, expected
):
    arm = small_arm(tmp_path)
    stage, (own, _) = healthy_stage(arm, name)
    taken_up = replace(
        stage.gain(own),
        overlap=0.95,
        prior=stage.prior + 20,
        held_out=np.array([share, 0.0]) * stage.held_squares,
        # A twentieth or two fifths of its Coulomb friction.
        coefficients=amount * np.eye(own.count)[0],
    )
    assert is_material(arm, stage, Weighed(taken_up, 30.0)) == expected


@pytest.mark.parametrize(("delay", "expected"), [(0.004, True), (0.001, False)])
def test_torque_that_is_late_at_all_joints_is_a_delay_whatever_the_parameters_make_of_it(
    tmp_path, delay, expected
):
    arm = small_arm(tmp_path)
    late = parse_injection(arm, f"torque_delay::delay={delay}")
    prepared = prepare(arm, simulated_runs(arm, [late], runs=2))
    stage = Stage.of(ground(prepared), [])
    gain = stage.gain(candidates(prepared, only=["torque_delay"])[0])
    against = replace(gain, prior=stage.prior - 0.5, held_out=squares(stage, 0.004))
    assert is_material(arm, stage, Weighed(against, 30.0)) == expected
