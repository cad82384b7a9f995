"""The diagnosis on robots whose fault is known: simulated ones, and a real TX-40."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis.correction.corrected_model import corrected_model
from diagnosis.diagnose import diagnose
from diagnosis.report.sentence import shrunk_in_words
from identification.errors import InputError
from studies.blind.hidden import hidden_error
from testbench.effects import parse_injection
from testbench.log import read_log
from testbench.robot import load_robot
from tests.diagnosed import exact_gap, simulated_runs
from tests.small_arm import PENDULUM, SCARA, small_arm


def _diagnosis(arm, *effects, without=(), seed=3, noise=0.002):
    injections = [parse_injection(arm, text) for text in effects]
    return diagnose(arm, simulated_runs(arm, injections, runs=3, seed=seed, noise=noise), without)


def test_a_healthy_robot_gets_no_effect(arm):
    found = _diagnosis(arm)
    assert found.verdict in ("none", "parameters")
    assert found.effects == ()


def test_a_model_with_wrong_masses_needs_parameters_only(arm):
    heavier = arm.parameters.copy().reshape(arm.joints, -1)
    heavier[:, :10] *= 1.15
    wrong = replace(arm, parameters=heavier.ravel())
    found = diagnose(wrong, simulated_runs(arm, [], runs=3))
    assert found.verdict == "parameters"
    assert np.sum(found.gap.parameters) < 0.7 * np.sum(found.gap.nominal)


@pytest.mark.parametrize(
    ("text", "joint"),
    [
        ("stribeck_friction:shoulder:extra=1.2,velocity=0.2", 0),
        ("transmission_ripple:elbow:amplitude=0.6,cycles=12", 1),
        ("load_dependent_friction:shoulder:coefficient=0.12", 0),
    ],
)
def test_the_effect_and_its_joint_are_named_and_the_gap_closes(arm, text, joint):
    found = _diagnosis(arm, text)
    assert found.verdict == "effect"
    assert (found.effects[0].effect, found.effects[0].joint) == (text.split(":")[0], joint)
    closed = found.gap.closed
    assert closed is not None
    assert closed > 0.8


@pytest.mark.parametrize(
    ("parameters", "effects", "floor", "expected"),
    [
        ([3.5, 1.0], [2.0, 0.2], [1.9, 0.1], "it explains 92% of what re-identified parameters leave above"),
        # The other joint's parameters predict one run worse than they did.
        (
            [3.5, 1.0],
            [4.0, 0.2],
            [1.9, 0.1],
            "it explains 89% of what re-identified parameters leave at elbow",
        ),
        ([1.01, 0.1], [1.0, 0.1], [1.0, 0.1], "re-identified parameters leave little but noise"),
        # The floor is known to about a third.
        ([1.2, 0.12], [1.25, 0.12], [1.0, 0.1], "re-identified parameters leave little but noise"),
        # What re-identification swallows may cost as much as it is worth there.
        ([3.5, 1.0], [3.6, 1.0], [1.9, 0.1], "on runs left out it explains no more"),
        (
            [1.2, 0.12],
            [1.05, 0.12],
            [1.0, 0.1],
            "it explains 68% of what re-identified parameters leave above",
        ),
    ],
)
def test_what_effects_explain_is_reported_of_their_joint_where_others_hide_it(
    arm, parameters, effects, floor, expected
):
    gap = exact_gap(*map(np.array, ([9.0, 2.0], parameters, effects, floor)))
    assert shrunk_in_words(arm, 1, gap).startswith(expected)


def test_a_delay_is_found_on_a_robot_of_one_joint(tmp_path):
    bench = small_arm(tmp_path, PENDULUM)
    delay = parse_injection(bench, "torque_delay::delay=0.005")
    (found,) = diagnose(bench, simulated_runs(bench, [delay], runs=3)).effects
    # Of one joint a drive that lags is much the same.
    assert {found.effect, *found.confusable_with} == {"torque_delay", "actuator_lag"}


@pytest.mark.parametrize(("law", "stiffness"), [("sine", 3.0), ("gas_spring", 2.0)])
def test_a_spring_is_named_with_its_law_and_size(arm, law, stiffness):
    text = f"gravity_spring:elbow:stiffness={stiffness},phase=0.7,law={law}"
    first = _diagnosis(arm, text).effects[0]
    assert (first.effect, first.joint, first.law) == ("gravity_spring", 1, law)
    named = first.parameters["stiffness"]
    assert named.value == pytest.approx(stiffness, abs=max(3 * named.std, 0.02 * stiffness))


def test_what_re_identification_swallows_is_found_in_the_shift_of_the_parameters(arm):
    found = _diagnosis(arm, "asymmetric_friction:elbow:offset=0.4,viscous_difference=0")
    assert (found.effects[0].effect, found.effects[0].joint) == ("asymmetric_friction", 1)
    assert found.effects[0].parameters["offset"].value == pytest.approx(0.4, rel=0.2)


def test_what_stands_out_against_all_other_joints_is_named_in_noise(arm):
    # Nine tenths of the joint's rest are noise.
    found = _diagnosis(arm, "load_dependent_friction:shoulder:coefficient=0.12", noise=0.1)
    assert [(e.effect, e.joint) for e in found.effects] == [("load_dependent_friction", 0)]


def test_a_gain_error_that_noise_hides_is_said_not_to_show(arm):
    gain = "torque_gain_error:elbow:relative=0.15"
    hidden, seen = _diagnosis(arm, gain, noise=0.2), _diagnosis(arm, gain)
    assert hidden.effects == ()
    assert ("torque_gain_error", 1) in hidden.not_observable
    assert [(e.effect, e.joint) for e in seen.effects] == [("torque_gain_error", 1)]


def test_a_law_is_refined_from_the_end_of_its_range(arm):
    first = _diagnosis(arm, "stribeck_friction:shoulder:extra=1.2,velocity=0.45,exponent=2").effects[0]
    assert (first.effect, first.joint) == ("stribeck_friction", 0)
    assert first.parameters["velocity"].value == pytest.approx(0.45, rel=0.15)


@pytest.mark.parametrize("delay", [0.008, 0.02])
def test_a_long_delay_is_named_alone_whether_or_not_the_controller_shakes(arm, delay):
    found = _diagnosis(arm, f"torque_delay::delay={delay}")
    assert [effect.effect for effect in found.effects] == ["torque_delay"]
    named = found.effects[0].parameters["delay"]
    assert named.value == pytest.approx(delay, rel=0.02)
    assert abs(named.value - delay) < 3 * named.std


def test_the_strongest_effect_comes_first_however_late_it_was_found(arm):
    # Pushes are library last.
    friction = "stribeck_friction:shoulder:extra=0.6,velocity=0.2"
    injections = [
        parse_injection(arm, text)
        for text in (friction, "external_contact:elbow:torque=20,start=1.5,duration=0.6")
    ]
    runs = simulated_runs(arm, injections[:1], runs=3) | {
        "run_2": simulated_runs(arm, injections, runs=3)["run_2"]
    }
    found = diagnose(arm, runs)
    named = [(each.effect, each.joint) for each in found.effects]
    assert named == [("external_contact", 1), ("stribeck_friction", 0)]


def test_a_push_alone_is_said_to_leave_a_gap(arm):
    found = _diagnosis(arm, "external_contact:elbow:torque=20,start=1.5,duration=0.6")
    assert [(each.effect, each.joint) for each in found.effects] == [("external_contact", 1)]
    assert found.sentence.startswith("The gap comes from external contact at elbow")


def test_what_no_motion_predicts_is_unknown_where_it_stands_out(models):
    robot = load_robot(models / "tx90.xml")
    runs = {}
    for name, run in simulated_runs(robot, [], runs=2).items():
        torque = run.torque.copy()
        torque[:, 2] += 0.12 * np.std(torque[:, 2]) * np.sin(2 * np.pi * 3.7 * run.time)
        runs[name] = replace(run, torque=torque)
    found = diagnose(robot, runs)
    assert (found.verdict, found.where[0].joint) == ("unknown", 2)


def test_an_effect_that_is_taken_out_of_the_catalogue_is_not_named(arm):
    text = "transmission_ripple:elbow:amplitude=0.8,cycles=3"
    found = _diagnosis(arm, text, without=("transmission_ripple", "external_contact"))
    assert all(effect.effect != "transmission_ripple" for effect in found.effects)
    assert found.where[0].joint == 1


@pytest.mark.parametrize(
    ("text", "followed"),
    [("transmission_ripple:elbow:amplitude=0.8,cycles=40", "cycles"), ("torque_delay::delay=0.006", "rate")],
)
def test_what_is_too_quick_for_a_smooth_function_is_unknown_without_its_law(arm, text, followed):
    found = _diagnosis(arm, text, without=(text.split(":")[0],))
    assert found.verdict == "unknown"
    assert followed in found.notes[0]


def test_a_payload_is_named_on_an_arm_that_does_not_feel_its_height(tmp_path):
    scara = small_arm(tmp_path, SCARA)
    found = _diagnosis(scara, "payload::mass=2.5,first_moment_x=0.1,first_moment_y=0.02,first_moment_z=-0.2")
    assert [effect.effect for effect in found.effects] == ["payload"]
    mass, moment = (found.effects[0].parameters[name] for name in ("mass", "first_moment"))
    assert abs(mass.value - 2.5) < 4 * mass.std
    # Nothing is said of the height.
    assert moment.std[2] > 100 * max(moment.std[:2])


def test_truth_in_a_log_changes_nothing(arm):
    runs = simulated_runs(arm, [parse_injection(arm, "stribeck_friction:shoulder:extra=1.2,velocity=0.2")])
    blind = {name: replace(run, truth={}, truth_effects=[]) for name, run in runs.items()}
    seen, unseen = diagnose(arm, runs), diagnose(arm, blind)
    assert seen.sentence == unseen.sentence
    assert np.array_equal(seen.parameters, unseen.parameters)


def test_runs_that_are_too_short_are_refused(arm):
    (name, run), *_ = simulated_runs(arm, [], runs=1).items()
    short = replace(
        run,
        **{
            field: getattr(run, field)[:200]
            for field in (
                "time",
                "position",
                "torque",
                "torque_command",
                "reference_position",
                "reference_velocity",
                "reference_acceleration",
            )
        },
    )
    with pytest.raises(InputError, match="at least .* samples"):
        diagnose(arm, {name: short})


@pytest.mark.parametrize(("given", "other"), [("half_1", "half_2"), ("half_2", "half_1")])
def test_half_of_the_real_tx40_run_names_the_coupling_and_predicts_the_other(real_data, given, other):
    folder = real_data / "tx40"
    found = diagnose(load_robot(folder / "nominal.xml"), {given: read_log(folder / f"{given}.h5")})
    assert [(each.effect, each.joint, each.into) for each in found.effects] == [("joint_coupling", 4, 5)]
    error = hidden_error(corrected_model(found), read_log(folder / f"{other}.h5"))
    torque = np.sqrt(np.sum(np.mean(read_log(folder / f"{other}.h5").torque ** 2, axis=0)))
    assert np.linalg.norm(error.corrected) / torque < 0.105 < np.linalg.norm(error.parameters) / torque


def test_the_real_tx40_has_its_wrist_coupling_named_first(real_data):
    folder = real_data / "tx40"
    robot = load_robot(folder / "nominal.xml")
    found = diagnose(robot, {name: read_log(folder / f"{name}.h5") for name in ("half_1", "half_2")})
    first = found.effects[0]
    assert (first.effect, first.joint, first.into) == ("joint_coupling", 4, 5)
    # The values published for this robot: .609 N·m·s/rad and 2.108 N·m.
    assert first.parameters["viscous"].value == pytest.approx(0.609, rel=0.1)
    assert first.parameters["coulomb"].value == pytest.approx(2.108, rel=0.15)
    design, fitted = found.final
    residual = np.linalg.norm(fitted.held_out[1])
    torque = np.linalg.norm(np.where(design.used[1], found.prepared.runs[1].torque, 0.0))
    assert residual / torque < 0.105
