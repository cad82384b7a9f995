"""What a motion does not move stays as the model has it, and no effect is library there."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis.correction.corrected_model import corrected_model
from diagnosis.correction.prediction import predict_torque
from diagnosis.data.preparation import prepare
from diagnosis.data.single_sine import one_sine
from diagnosis.diagnose import diagnose
from diagnosis.model.candidates import candidates
from diagnosis.model.effect_sizes import is_plausible
from testbench.effects.payload import TOOL_REACH, arm_length
from testbench.log import Recording
from testbench.robot import Robot

from ...diagnosed import measured_only, simulated_runs
from ...small_arm import small_arm

ELBOW = 1
STEP = 2e-3


@pytest.fixture
def arm(tmp_path) -> Robot:
    return small_arm(tmp_path)


def _dithering(run: Recording) -> Recording:
    """The run with its elbow held, as an encoder of a few counts reports that."""
    counts = np.random.default_rng(0).integers(0, 2, len(run.time))
    position = run.position.copy()
    position[:, ELBOW] = position[0, ELBOW] + STEP * counts
    return replace(measured_only(run), position=position)


@pytest.fixture
def held(arm: Robot) -> dict[str, Recording]:
    return {name: _dithering(run) for name, run in simulated_runs(arm, [], runs=2).items()}


def test_counting_up_and_down_is_no_motion(arm, held):
    prepared = prepare(arm, held)
    assert prepared.still == {ELBOW}
    assert not any(run.used[:, ELBOW].any() for run in prepared.runs)


def test_no_effect_is_a_candidate_where_a_joint_stands_still(arm, held):
    places = {each.place for each in candidates(prepare(arm, held))}
    assert {joint for _, joint, _ in places} == {0, None}
    assert not any(into == ELBOW for _, _, into in places)


def test_joints_that_never_move_together_have_no_coupling(arm):
    runs = dict(simulated_runs(arm, [], runs=2))
    for (name, run), still in zip(list(runs.items()), (0, 1), strict=True):
        position = run.position.copy()
        position[:, still] = position[0, still]
        runs[name] = replace(measured_only(run), position=position)
    prepared = prepare(arm, runs)
    assert not prepared.still
    assert not candidates(prepared, only=["joint_coupling"])
    # Of two runs each joint has one, and so has the robot.
    assert [prepared.runs_with(joint) for joint in (0, 1, None)] == [1, 1, 1]
    assert prepared.runs_with(0, 1) == 0
    assert prepare(arm, simulated_runs(arm, [], runs=2)).runs_with(0, 1) == 2
    assert candidates(prepare(arm, simulated_runs(arm, [], runs=2)), only=["joint_coupling"])


def test_the_torque_of_a_joint_that_stood_still_is_predicted_as_the_model_given_has_it(arm, held):
    found = diagnose(arm, held)
    predicted = predict_torque(corrected_model(found), simulated_runs(arm, [], runs=3)["run_3"])
    for torque in (predicted.parameters, predicted.corrected):
        np.testing.assert_array_equal(torque[:, ELBOW], predicted.nominal[:, ELBOW])


def test_a_payload_lies_where_a_tool_can_be(arm):
    prepared = prepare(arm, simulated_runs(arm, [], runs=1))
    (payload,) = candidates(prepared, only=["payload"])
    centre = TOOL_REACH * arm_length(arm.chain)
    ten = np.zeros(10)
    origin = prepared.runs[0].logged.body_origin
    for reach, plausible in ((0.9, True), (1.1, False)):
        ten[9] = 2.0
        ten[6:9] = 2.0 * (origin + np.array([reach * centre, 0.0, 0.0]))
        assert is_plausible(arm, payload, ten) == plausible
    ten[9] = 0.0
    assert not is_plausible(arm, payload, ten)


def _along(arm: Robot, waves: tuple[float, ...]) -> Recording:
    """A run of 8 s in which both joints move by the sum of some waves, Hz."""
    run = simulated_runs(arm, [], runs=1)["run_1"]
    time = np.arange(8000) / 1000.0
    q = sum(0.3 * np.sin(2 * np.pi * hertz * time) for hertz in waves)
    position = np.column_stack([q, 0.5 * q])
    return replace(measured_only(run), time=time, position=position, torque=np.cos(position))


@pytest.mark.parametrize(("waves", "sines"), [((0.3,), {0, 1}), ((0.3, 0.8), set()), ((0.1,), set())])
def test_joints_that_follow_one_sine_are_found(arm, waves, sines):
    assert one_sine(prepare(arm, {"run": _along(arm, waves)})) == sines


def test_no_effect_has_a_name_where_all_joints_follow_one_sine(arm):
    run = _along(arm, (0.3,))
    torque = 20 * np.sin(3 * run.position) + 5 * np.sign(np.gradient(run.position, axis=0))
    found = diagnose(arm, {"one": replace(run, torque=torque), "two": replace(run, torque=torque)})
    assert found.effects == ()
    assert found.one_sine == {0, 1}


def test_joints_that_only_ever_move_by_themselves_get_no_effect_without_a_name(arm):
    runs = dict(simulated_runs(arm, [], runs=2))
    for (name, run), still in zip(list(runs.items()), (0, 1), strict=True):
        position = run.position.copy()
        position[:, still] = position[0, still]
        # A law of no robot: all that is fitted has no name.
        torque = run.torque + 2 * np.sin(7 * position) * np.tanh(np.gradient(position, axis=0) * 300)
        runs[name] = replace(measured_only(run), position=position, torque=torque)
    found = diagnose(arm, runs)
    assert found.prepared.by_itself.all()
    named = {each.joint for each in found.effects}
    assert all(found.kept.effects[joint] == 0 for joint in range(2) if joint not in named)
    assert np.all(found.gap.effects <= found.gap.parameters * (1 + 1e-9))
