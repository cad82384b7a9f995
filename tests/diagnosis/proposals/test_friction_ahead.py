"""MuJoCo's own frictionloss changes sign ahead of the joints; logs of it are no robot with an effect."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from diagnosis.correction.corrected_mjcf import write_corrected
from diagnosis.correction.corrected_model import corrected_model
from diagnosis.correction.correction_document import correction_document, read_correction
from diagnosis.correction.prediction import predict_torque
from diagnosis.data.preparation import prepare
from diagnosis.diagnose import diagnose
from diagnosis.report.notes import near_rest
from diagnosis.search.growth import attribute
from testbench.effects.logged import logged_run
from testbench.log import Recording
from testbench.robot import Robot

from ...diagnosed import simulated_runs

# s: half of what the time constant and MuJoCo's largest impedance, .95, make of each other.
TIME_CONSTANT = 0.02
LEAD = 0.95 * TIME_CONSTANT / 2
STEP, NOISE = 5e-4, 0.01
GAINS = np.array([[900.0, 300.0], [40.0, 12.0]])


def _of_mujoco(arm: Robot, spring: float = 0.0) -> dict[str, Recording]:
    """Runs in plain MuJoCo under a PD controller, friction as the file has it. spring: N·m/rad, elbow."""
    rng, runs = np.random.default_rng(8), {}
    model = mujoco.MjModel.from_xml_path(str(arm.path))
    model.opt.timestep = STEP
    model.dof_solref[:, 0] = TIME_CONSTANT
    model.jnt_stiffness[1] = spring
    for name, run in simulated_runs(arm, [], runs=3, noise=0.0).items():
        assert run.reference_position is not None
        assert run.reference_velocity is not None
        data = mujoco.MjData(model)
        data.qpos[:] = run.reference_position[0]
        position, torque = np.empty((2, *run.position.shape))
        each = round(1 / (run.sample_rate * STEP))
        for k, (q, v) in enumerate(zip(run.reference_position, run.reference_velocity, strict=True)):
            data.qfrc_applied[:] = GAINS[0] * (q - data.qpos) + GAINS[1] * (v - data.qvel)
            position[k], torque[k] = data.qpos, data.qfrc_applied
            mujoco.mj_step(model, data, each)
        noisy = torque + rng.normal(0, NOISE, torque.shape)
        runs[name] = replace(run, position=position, torque=noisy, velocity=None, torque_command=None)
    return runs


@pytest.fixture(scope="module")
def logs(arm: Robot) -> dict[str, Recording]:
    return _of_mujoco(arm)


def test_the_lead_is_that_of_the_soft_constraint_and_has_no_name(arm, logs):
    found = attribute(prepare(arm, logs))
    assert not [a.candidate.family.effect for a in found.accepted if a.named]
    assert found.unknown == ()
    # A sample of the log either way.
    assert found.prepared.coulomb_lead == pytest.approx(LEAD, abs=1e-3)


def test_friction_that_turns_with_the_joint_has_no_lead(arm):
    assert attribute(prepare(arm, simulated_runs(arm, [], runs=3))).prepared.coulomb_lead == 0


def test_an_effect_beside_it_is_named_alone(arm):
    found = attribute(prepare(arm, _of_mujoco(arm, spring=3.0)))
    named = [(a.candidate.family.effect, a.candidate.family.joint) for a in found.accepted if a.named]
    assert named == [("cable_spring", 1)]


def test_it_is_found_kept_and_predicted(arm, logs, tmp_path):
    found = diagnose(arm, logs)
    assert "ahead of the joints" in near_rest(found)[-1]
    assert any(
        "ahead of the joints" in each for each in write_corrected(found, tmp_path / "corrected.xml").lacks
    )
    model = read_correction(correction_document(corrected_model(found)), "written")
    assert model.coulomb_lead == found.prepared.coulomb_lead
    run = next(iter(logs.values()))
    sharp = replace(model, coulomb_lead=0.0, coulomb_smoothing=np.zeros(arm.joints))
    left = [predict_torque(each, run).corrected - run.torque for each in (model, sharp)]
    along = logged_run(arm, run, arm.parameters, 80.0)
    turned = np.sign(along.dq) != np.sign(along.dq + LEAD * along.ddq)
    # There a jump with the joint is off by twice the Coulomb friction.
    ahead, jumping = (np.sqrt(np.mean(each[turned] ** 2)) for each in left)
    assert ahead < 0.5 * jumping
