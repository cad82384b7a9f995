"""Columns, signs, zeros, scales and gravity that are not the model's, found together."""

from dataclasses import replace

import numpy as np
import pytest

from identification.inverse_dynamics import inverse_dynamics
from identification.parameters import ARMATURE, COULOMB, INERTIAL, PER_JOINT, VISCOUS
from recordings.checks import Severity
from recordings.checks.convention import as_modelled
from recordings.checks.conventions import check
from recordings.checks.finding import barred_joints
from recordings.checks.model_fit import ModelFit
from recordings.checks.samples import slow_samples
from recordings.checks.subject import Subject
from testbench.cli import main
from testbench.effects import parse_injection
from testbench.log import Recording, write_log
from testbench.robot import Robot, load_robot

from ..diagnosed import simulated_runs
from ..diagnosis.output.arm import ARM, LIFT
from ..small_arm import SCARA, small_arm
from ..synthetic import synthetic_result, synthetic_robot


@pytest.fixture(scope="module")
def robot(tmp_path_factory) -> Robot:
    return synthetic_robot(tmp_path_factory.mktemp("arm"))


@pytest.fixture(scope="module")
def healthy(robot) -> Recording:
    """Eight seconds of a turret, a lift and a ram."""
    return synthetic_result(robot, 8.0).fit_recordings[0]


def _found(robot: Robot, *recordings: Recording) -> dict[str, tuple[Severity, tuple[str, ...], str]]:
    runs = {f"run_{index + 1}": each for index, each in enumerate(recordings)}
    return {each.code: (each.severity, each.joints, each.sentence) for each in check(Subject(robot, runs))}


def test_a_healthy_log_has_the_models_convention(robot, healthy):
    assert _found(robot, healthy) == {}


@pytest.mark.parametrize("joints", [(0, 1, 2), (1,)])
def test_torque_counted_backwards_is_reported_with_its_joints(robot, healthy, joints):
    sign = np.where(np.isin(np.arange(3), joints), -1.0, 1.0)
    found = _found(robot, replace(healthy, torque=healthy.torque * sign))
    names = tuple(robot.joint_names[joint] for joint in joints)
    assert found == {"torque_sign": (Severity.STOP, names, f"the opposite at {', '.join(names)}")}


def test_a_position_that_counts_backwards_is_reported(robot, healthy):
    found = _found(robot, replace(healthy, position=healthy.position * [1, -1, 1]))
    assert found["position_sign"][1] == (robot.joint_names[1],)


@pytest.mark.parametrize("channel", ["torque", "position"])
def test_columns_that_are_swapped_are_reported_with_their_joints(robot, healthy, channel):
    swapped = replace(healthy, **{channel: getattr(healthy, channel)[:, [1, 0, 2]]})
    severity, joints, _ = _found(robot, swapped)[f"{channel}_order"]
    assert (severity, joints) == (Severity.STOP, robot.joint_names[:2])


def test_a_zero_and_a_sign_that_hide_each_other_are_found_together(tmp_path):
    crane = small_arm(tmp_path, ARM)
    off = np.eye(crane.joints)[LIFT] * np.pi / 2
    sign = np.array([1.0, 1.0, -1.0])
    runs = [
        replace(run, position=run.position + off, torque=sign * run.torque)
        for run in simulated_runs(crane, [], runs=2).values()
    ]
    found = _found(crane, *runs)
    assert {code: joints for code, (_, joints, _) in found.items()} == {
        "torque_sign": ("reach",),
        "zero_off": ("lift",),
    }
    # The log reads a right angle, to three degrees, where the model has 0.
    angle = float(found["zero_off"][2].split()[1].rstrip("°"))
    assert angle == pytest.approx(90, abs=3)


@pytest.mark.parametrize(("factor", "unit"), [(1000.0, "N·mm"), (0.01, "another unit")])
def test_torque_in_another_unit_is_reported_as_one_of_all_joints(arm, healthy_runs, factor, unit):
    found = _found(arm, *(replace(run, torque=factor * run.torque) for run in healthy_runs.values()))
    severity, joints, sentence = found["torque_scale"]
    assert (severity, joints) == (Severity.STOP, arm.joint_names)
    assert sentence.startswith("that of every joint is")
    assert unit in sentence


def test_torque_without_gravity_is_said_both_ways_and_goes_on(arm, healthy_runs):
    links = arm.parameters.reshape(-1, PER_JOINT).copy()
    links[:, INERTIAL:] = 0

    def compensated(run: Recording) -> Recording:
        still = np.zeros_like(run.position)
        return replace(
            run, torque=run.torque - inverse_dynamics(arm.chain, links.ravel(), run.position, still, still)
        )

    found = _found(arm, *(compensated(run) for run in healthy_runs.values()))
    severity, _, sentence = found["no_gravity"]
    assert severity is Severity.WARN
    assert "compensation" in sentence
    assert "counterweights" in sentence


@pytest.mark.parametrize("down", [(9.81, 0.0, 0.0), (-6.0, 0.0, -7.8)])
def test_gravity_that_points_elsewhere_is_another_mounting(arm, healthy_runs, down):
    modelled = replace(arm, chain=replace(arm.chain, gravity=np.array(down)))
    assert "mounting" in _found(modelled, *healthy_runs.values())


def test_links_twice_as_heavy_as_the_model_s_are_no_other_mounting(arm, healthy_runs):
    light = arm.parameters.reshape(-1, PER_JOINT).copy()
    light[:, :INERTIAL] /= 2.4
    found = _found(replace(arm, parameters=light.ravel()), *healthy_runs.values())
    assert "mounting" not in found


def test_a_scale_is_said_of_the_joints_that_move(arm, healthy_runs):
    def still(run: Recording) -> Recording:
        position = np.where(np.arange(arm.joints) == 0, run.position[:1], run.position)
        return replace(run, position=position, torque=1000 * run.torque)

    _, joints, _ = _found(arm, *(still(run) for run in healthy_runs.values()))["torque_scale"]
    assert joints == arm.joint_names[1:]


def test_where_another_unit_is_only_suspected_no_effect_is_named(arm, healthy_runs):
    """The model leaves too much of this torque for the unit to be certain, which would stop."""

    def odd(run: Recording) -> Recording:
        torque = run.torque * [1.0, 0.005]
        torque[:, 1] += np.std(torque[:, 1]) * np.sin(9 * run.time)
        return replace(run, torque=torque)

    runs = {name: odd(run) for name, run in healthy_runs.items()}
    (found,) = check(Subject(arm, runs))
    assert (found.code, found.severity, found.bars_names) == ("torque_scale", Severity.WARN, False)
    assert barred_joints([found]) == {"elbow"}


def test_a_cable_of_one_joint_is_no_mistake(arm):
    cable = parse_injection(arm, "cable_spring:elbow:stiffness=3,rest=0.4")
    assert _found(arm, *simulated_runs(arm, [cable]).values()) == {}


def test_a_model_with_wrong_masses_and_no_friction_stops_no_healthy_log(robot, healthy):
    rng = np.random.default_rng(2)
    for _ in range(4):
        table = robot.parameters.reshape(-1, PER_JOINT) * np.exp(0.2 * rng.normal(size=(3, 1)))
        table[:, ARMATURE:] = 0
        found = _found(replace(robot, parameters=table.ravel()), healthy)
        assert all(severity is not Severity.STOP for severity, _, _ in found.values())


@pytest.mark.parametrize("command", ["identify", "diagnose"])
def test_commands_refuse_such_a_log_by_its_file(robot, healthy, tmp_path, capsys, command):
    path = tmp_path / "run.h5"
    write_log(replace(healthy, torque=-healthy.torque, reference_position=None), path)
    with pytest.raises(SystemExit, match="2"):
        main([command, "--model", str(robot.path), str(path), "--out", str(tmp_path / "out")])
    line = capsys.readouterr().err
    assert line.startswith(f"{path}: joint/torque: expected the sign that turns a joint")
    assert line.count("\n") == 1


def _in_turn(robot: Robot, *joints: int) -> list[Recording]:
    """Logs of joints that move one at a time, with a third of the model's friction and noise."""
    table = robot.parameters.reshape(-1, PER_JOINT).copy()
    table[:, ARMATURE + 1 :] *= 0.3
    time = np.arange(0, 6, 0.002)
    logs = []
    for number, joint in enumerate(joints):
        position = np.zeros((len(time), robot.joints))
        position[:, joint] = 1.2 * np.sin(np.pi * time / 6) ** 2
        velocity = np.gradient(position, time, axis=0)
        acceleration = np.gradient(velocity, time, axis=0)
        torque = inverse_dynamics(robot.chain, table.ravel(), position, velocity, acceleration)
        noise = np.random.default_rng(number).normal(size=torque.shape)
        torque = torque + 0.05 * np.sqrt(np.mean(torque**2)) * noise
        logs.append(Recording(robot.name, robot.joint_names, 500.0, "test", time, position, torque))
    return logs


def test_a_convention_does_not_choose_the_samples_that_it_is_judged_by(tmp_path):
    (tmp_path / "scara.xml").write_text(SCARA)
    robot = load_robot(tmp_path / "scara.xml")
    samples = slow_samples(_in_turn(robot, 0, 1))
    assert samples is not None
    as_it_is = as_modelled(robot.joints)
    exchanged = replace(as_it_is, position_order=(1, 0, 2))
    left = [ModelFit(robot, samples).under(each).left[:2] for each in (as_it_is, exchanged)]
    assert np.all(left[0] < 0.3)
    # The torque of a joint that would have stood still stays unexplained.
    assert np.all(left[1] > 0.5)


@pytest.mark.parametrize("guess", [0.0, 0.05])
def test_friction_and_rotors_that_a_model_only_guesses_are_no_other_unit_of_torque(tmp_path, guess):
    """A tenth of the drives' torque, by a model that has none, or the same at all joints."""
    (tmp_path / "scara.xml").write_text(SCARA)
    robot = load_robot(tmp_path / "scara.xml")
    table = robot.parameters.reshape(-1, PER_JOINT).copy()
    table[:, COULOMB] = 0.1 * robot.limits.torque / 0.3  # of which the logs have a third
    logs = _in_turn(replace(robot, parameters=table.ravel().copy()), 0, 1)
    table[:, [ARMATURE, VISCOUS, COULOMB]] = guess
    model = replace(robot, parameters=table.ravel())
    assert "torque_scale" not in _found(model, *logs)
    in_millinewton = [replace(each, torque=1000 * each.torque) for each in logs]
    assert _found(model, *in_millinewton)["torque_scale"][0] is Severity.STOP
