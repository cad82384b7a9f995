"""Springs that a model has at its joints are known: in the torque, in what is identified, in a diagnosis."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis.correction.corrected_mjcf import write_corrected
from diagnosis.correction.corrected_model import corrected_model
from diagnosis.correction.correction_document import Corrected, correction_document, read_correction
from diagnosis.correction.prediction import predict_torque
from diagnosis.diagnose import diagnose
from identification.base_parameters import base_parameters
from identification.estimators import estimate
from identification.excitation.constraints import SmoothConstraints
from identification.filtering import zero_phase_lowpass
from identification.inverse_dynamics import inverse_dynamics
from identification.models import Preprocessing, identification_models, observe
from identification.problem import Problem
from testbench.effects import parse_injection
from testbench.jobs.parity import mujoco_torques
from testbench.robot import Robot, load_robot
from testbench.sampling import motion

from ..diagnosed import RATE, simulated_runs
from ..small_arm import ARM, SCARA, small_arm

SHOULDER, ELBOW = 30.0, 6.0
SPRUNG = ARM.replace('name="shoulder"', f'name="shoulder" stiffness="{SHOULDER} 4 2" springref=".6"').replace(
    'name="elbow"', f'name="elbow" stiffness="{ELBOW}" springref="-.3"'
)


@pytest.fixture(scope="module")
def sprung(tmp_path_factory: pytest.TempPathFactory) -> Robot:
    return small_arm(tmp_path_factory.mktemp("sprung"), SPRUNG)


@pytest.mark.parametrize(
    ("xml", "pulls"),
    [
        (SPRUNG, True),
        (SCARA.replace('name="lift"', 'name="lift" stiffness="900 50 4000" springref="-.1"'), True),
        (SPRUNG.replace("<worldbody>", '<option><flag spring="disable"/></option><worldbody>'), False),
        (SPRUNG.replace('springref="-.3"', 'springref="-.3" ref=".5"'), True),
    ],
)
def test_inverse_dynamics_has_the_springs_of_mujoco(tmp_path, xml, pulls):
    robot = small_arm(tmp_path, xml)
    q, dq, ddq = np.random.default_rng(1).normal(size=(3, 20, robot.joints))
    ours = inverse_dynamics(robot.chain, robot.parameters, q, dq, ddq)
    friction = robot.parameters.reshape(-1, 14)[:, 12] * np.sign(dq)
    np.testing.assert_allclose(ours - friction, mujoco_torques(robot.model, q, dq, ddq), rtol=1e-9, atol=1e-9)
    assert robot.chain.springs.any() == pulls


@pytest.mark.parametrize("name", [*identification_models(), "extended_kalman"])
def test_what_is_identified_is_the_arm_without_its_springs(sprung, name):
    is_filter = name == "extended_kalman"
    options = Preprocessing(model="inverse_dynamic" if is_filter else name)
    runs = simulated_runs(sprung, [], noise=0.001)
    motions = tuple(motion(each) for each in runs.values())
    base = base_parameters(sprung.chain)
    truth = base.values(sprung.parameters)

    def error(robot: Robot) -> float:
        written = tuple(observe(robot.chain, base, each, options) for each in motions)
        problem = Problem(robot.chain, base, written, motions, options, robot.parameters)
        values = estimate(problem, name if is_filter else "wls").values
        return float(np.abs(values - truth).max())

    unsprung = replace(sprung, chain=sprung.chain.without_springs())
    assert error(sprung) < 0.03 * error(unsprung)


def test_the_torque_limit_of_a_design_has_the_exact_gradient_of_a_spring(sprung):
    constraints = SmoothConstraints(sprung.chain, sprung.parameters, sprung.limits, None)
    rng = np.random.default_rng(2)
    q, dq, ddq = rng.normal(size=(3, 30, 2))
    direction = rng.normal(size=q.shape)

    def values(step: float) -> np.ndarray:
        return constraints.values(q + step * direction, dq, ddq)

    slopes = (values(1e-6) - values(-1e-6)) / 2e-6
    gradients = [np.sum(bars[0] * direction) for bars in constraints.gradients(q, dq, ddq)]
    np.testing.assert_allclose(gradients, slopes, rtol=1e-5, atol=1e-7)


def test_a_spring_of_the_model_is_no_gap(sprung):
    found = diagnose(sprung, simulated_runs(sprung, [], runs=3))
    assert not found.effects
    assert np.all(found.gap.nominal < 1.1 * found.gap.noise_floor)


def test_a_cable_beside_a_spring_is_found_and_both_are_in_the_corrected_model(sprung, tmp_path):
    stiffness, rest = 4.0, 0.5
    cable = parse_injection(sprung, f"cable_spring:elbow:stiffness={stiffness},rest={rest}")
    found = diagnose(sprung, simulated_runs(sprung, [cable], runs=3))
    (named,) = found.effects
    assert (named.effect, named.joint) == ("cable_spring", 1)
    quantity = named.parameters["stiffness"]
    assert abs(quantity.value - stiffness) < 4 * quantity.std
    write_corrected(found, tmp_path / "corrected.xml")
    corrected = load_robot(tmp_path / "corrected.xml").chain.springs[1]
    total = ELBOW + quantity.value
    rests = -0.3 * ELBOW + named.parameters["rest"].value * quantity.value
    np.testing.assert_allclose(corrected, [total, 0, 0, rests / total], rtol=1e-6)


def test_a_prediction_has_the_springs(sprung):
    runs = simulated_runs(sprung, [], runs=4)
    held = runs.pop("run_4")
    model = read_correction(correction_document(corrected_model(diagnose(sprung, runs))), "correction")

    def error(model: Corrected) -> np.ndarray:
        """RMS (n,) N·m in the band of the diagnosis."""
        left = zero_phase_lowpass(predict_torque(model, held).corrected - held.torque, RATE, 20.0)
        return np.sqrt(np.mean(left**2, axis=0))

    assert np.all(error(model) < 0.1 * error(replace(model, chain=model.chain.without_springs())))
