"""A push that comes in every run alike can be predicted along another run; one of a single run cannot."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis.correction.corrected_model import corrected_model
from diagnosis.correction.prediction import predict_torque, term_torque
from diagnosis.held_out.recurring_push import recurrence
from testbench.effects import parse_injection

from ...diagnosed import diagnosed, simulated_runs

ELBOW = 1
NOISE = 0.02


def _pushed(arm, law, runs):
    text = f"external_contact:elbow:law={law},torque=6,start=2,duration=0.6"
    return simulated_runs(arm, [parse_injection(arm, text)], runs=runs, noise=NOISE)


@pytest.mark.parametrize("law", ["link_force", "world_force", "joint_torque"])
def test_a_push_of_every_run_is_predicted_along_another(arm, law):
    runs = _pushed(arm, law, 4)
    unseen = runs.pop("run_4")
    answer = diagnosed(arm, runs, [("external_contact", ELBOW, None)])
    found = recurrence(*answer.final)
    assert found is not None
    pushed, apart = (unseen.time > 2.1) & (unseen.time < 2.5), np.abs(unseen.time - 2.3) > 0.5

    def error(diagnosis, samples):
        predicted = predict_torque(corrected_model(diagnosis), unseen).corrected
        return np.sqrt(np.mean((predicted - unseen.torque)[samples, ELBOW] ** 2))

    assert error(answer, pushed) > 4.0
    # A tenth of the push, beside what accelerations of an encoder leave at any time.
    bound = np.hypot(0.1 * error(answer, pushed), error(answer, apart))
    assert error(replace(answer, recurrence=found), pushed) < bound
    # Along a run that shows a push of its own, too.
    (term,) = corrected_model(replace(answer, recurrence=found)).terms
    logged = answer.prepared.runs[0].logged
    torque = term_torque(term, logged)[:, ELBOW]
    during = np.abs(logged.time - 2.3) < 0.2
    assert np.sqrt(np.mean(torque[during] ** 2)) > 4.0
    assert not torque[np.abs(logged.time - 2.3) > 0.7].any()


def test_a_push_of_one_run_is_none_of_the_robot(arm):
    runs = simulated_runs(arm, [], runs=3, noise=NOISE)
    runs["run_2"] = _pushed(arm, "link_force", 3)["run_2"]
    answer = diagnosed(arm, runs, [("external_contact", ELBOW, None)])
    assert recurrence(*answer.final) is None
    assert corrected_model(answer).terms == ()
