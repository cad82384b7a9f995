"""Zeros that lie degrees off: found exactly, named at their joint, and predicted at their size."""

import numpy as np
import pytest

from diagnosis.correction.correction_document import DOCUMENT
from diagnosis.correction.prediction import predict_torque, read_diagnosed
from diagnosis.data.preparation import prepare
from diagnosis.diagnose import diagnose
from diagnosis.fit.encoder_zeros import likeliest_zero
from diagnosis.fit.linearisation import first_linearised, linearised_anew
from diagnosis.fit.normal_equations import fitted_to
from diagnosis.model.base_regressor import BaseRegressor
from diagnosis.model.candidates import candidates
from diagnosis.report.document import write_diagnosis
from diagnosis.search import growth
from diagnosis.search.growth import attribute
from identification.inverse_dynamics import inverse_dynamics
from identification.parameters import ARMATURE, without_friction
from testbench.effects import parse_injection

from ...diagnosed import measured_only, simulated_runs
from ...small_arm import small_arm
from ..output.arm import ARM

LIFT = 1


@pytest.fixture(scope="module")
def crane(tmp_path_factory):
    return small_arm(tmp_path_factory.mktemp("crane"), ARM)


def _runs(crane, offset, runs=3):
    injected = [parse_injection(crane, f"encoder_offset:lift:offset={offset}")]
    return {name: measured_only(run) for name, run in simulated_runs(crane, injected, runs=runs).items()}


@pytest.mark.parametrize("degrees", [-20, -6, 4, 11])
def test_a_zero_that_lies_degrees_off_is_found_with_its_joint(crane, degrees):
    offset = np.deg2rad(degrees)
    hypothesis, fitted = fitted_to(BaseRegressor(prepare(crane, _runs(crane, offset))), [])
    found = likeliest_zero(hypothesis, fitted)
    assert found is not None
    assert found.joint == LIFT
    # The masses are the model's, so that the prior pulls nowhere else: within half a degree.
    assert found.offset == pytest.approx(offset, abs=np.deg2rad(0.5))


def test_a_healthy_robot_has_its_zeros_where_the_model_has_them(crane):
    assert likeliest_zero(*fitted_to(BaseRegressor(prepare(crane, _runs(crane, 0.0))), [])) is None


def test_an_offset_that_is_far_from_small_is_exact(crane):
    offset = np.deg2rad(15)
    prepared = first_linearised(prepare(crane, _runs(crane, offset)))
    assert prepared.zeros[LIFT] == pytest.approx(offset, abs=np.deg2rad(0.5))
    own = [each for each in candidates(prepared, only=["encoder_offset"]) if each.family.joint == LIFT]
    hypothesis, fitted = linearised_anew(*linearised_anew(*fitted_to(BaseRegressor(prepared), own)))
    assert fitted.values[-1] == pytest.approx(offset, abs=np.deg2rad(0.5))
    run, known = hypothesis.prepared.runs[0].logged, hypothesis.prepared.zeros[LIFT]
    moved = hypothesis.accepted[0].member.columns[0][:, :, 0] * known
    there = run.q - known * np.eye(crane.joints)[LIFT]
    links = without_friction(run.parameters)
    rotors = run.table[:, ARMATURE] * run.ddq
    exact = inverse_dynamics(crane.chain, links, there, run.dq, run.ddq) - rotors
    assert np.allclose(moved, exact - (run.load - run.carried), atol=1e-9)


def test_it_has_a_name_and_another_run_is_predicted_by_it(crane, tmp_path):
    offset = np.deg2rad(11)
    runs = _runs(crane, offset, runs=4)
    unseen = runs.pop("run_4")
    found = diagnose(crane, runs)
    assert [(each.effect, each.joint) for each in found.effects][:1] == [("encoder_offset", LIFT)]
    write_diagnosis(found, tmp_path / DOCUMENT)
    model = read_diagnosed(tmp_path)
    assert model.zeros[LIFT] == pytest.approx(offset, abs=np.deg2rad(1))
    predicted = predict_torque(model, unseen)
    middle = slice(200, -200)
    left = np.sqrt(np.mean((unseen.torque - predicted.corrected)[middle] ** 2, axis=0))
    alone = np.sqrt(np.mean((unseen.torque - predicted.parameters)[middle] ** 2, axis=0))
    assert left[LIFT] < alone[LIFT]


def test_a_zero_that_is_not_among_the_first_that_are_found_is_given_up_and_found_as_an_effect(
    crane, monkeypatch
):
    ripple = parse_injection(crane, "transmission_ripple:turn:amplitude=40,cycles=15,phase=0.2")
    offset = parse_injection(crane, f"encoder_offset:lift:offset={np.deg2rad(11)}")
    prepared, begun = prepare(crane, simulated_runs(crane, [offset, ripple], runs=3)), []
    linearised = growth.first_linearised

    def first_linearised(prepared, seeks_zero):
        begun.append(seeks_zero)
        return linearised(prepared, seeks_zero)

    monkeypatch.setattr(growth, "first_linearised", first_linearised)
    monkeypatch.setattr(growth, "FIRST_TAKEN", 1)
    found = attribute(prepared)
    assert begun == [True, False]
    assert [item.candidate.place[:2] for item in found.accepted if item.named] == [
        ("transmission_ripple", 0),
        ("encoder_offset", LIFT),
    ]
