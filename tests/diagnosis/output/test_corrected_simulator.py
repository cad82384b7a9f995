"""The corrected simulator: in plain MuJoCo, and in closed loop against the log."""

from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

from diagnosis.correction.corrected_mjcf import corrections, write_corrected
from diagnosis.decision.findings import Diagnosis
from testbench.log import Recording
from testbench.robot import Robot

from ...diagnosed import in_closed_loop
from .arm import LIFT


def test_corrected_model_runs_in_plain_mujoco_and_keeps_names_and_exterior(
    answer: Diagnosis, tmp_path: Path, robot: Robot
) -> None:
    write_corrected(answer, tmp_path / "corrected.xml")
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "corrected.xml"))
    assert [model.joint(j).name for j in range(3)] == list(robot.joint_names)
    assert model.geom("shell").rgba[0] == pytest.approx(0.9)
    assert [model.actuator(i).name for i in range(3)] == ["drive_turn", "drive_lift", "drive_reach"]
    assert list(tmp_path.iterdir()) == [tmp_path / "corrected.xml"]
    data = mujoco.MjData(model)
    for _ in range(500):
        mujoco.mj_step(model, data)
    assert np.isfinite(data.qpos).all()
    assert data.time == pytest.approx(500 * model.opt.timestep)


def test_injections_carry_the_named_values(answer: Diagnosis) -> None:
    first = corrections(answer)[0]
    assert (first.effect, first.joint) == ("stribeck_friction", LIFT)
    assert first.values["extra"] == answer.effects[0].parameters["extra"].value


def test_closed_loop_gap_shrinks_with_the_effect(answer: Diagnosis, runs: dict[str, Recording]) -> None:
    gap = in_closed_loop(answer, {"run_3": runs["run_3"]})
    assert gap is not None
    assert not gap.failed
    assert gap.torque["effects"][LIFT] < 0.6 * gap.torque["parameters"][LIFT]
    assert gap.torque["effects"][LIFT] < 0.6 * gap.torque["nominal"][LIFT]


def test_no_closed_loop_without_a_known_controller(answer: Diagnosis, runs: dict[str, Recording]) -> None:
    assert in_closed_loop(answer, {"run_1": replace(runs["run_1"], controller=None)}) is None
    assert in_closed_loop(answer, {"run_1": replace(runs["run_1"], reference_position=None)}) is None
