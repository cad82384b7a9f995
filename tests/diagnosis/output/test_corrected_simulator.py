"""The corrected simulator: in plain MuJoCo, and in closed loop against the log."""

from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

from diagnosis.correction.corrected_mjcf import corrected_simulator, reidentified_simulator, write_corrected
from diagnosis.decision.findings import Diagnosis
from diagnosis.held_out.shrinkage import Kept
from identification.base_parameters import base_parameters
from identification.parameters import GROUPS, PER_JOINT, VISCOUS
from testbench.effects import injection
from testbench.log import Recording
from testbench.robot import Robot

from ...diagnosed import diagnosed, in_closed_loop, simulated_runs
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
    first = corrected_simulator(answer).effects[0]
    assert (first.effect, first.joint) == ("stribeck_friction", LIFT)
    assert first.values["extra"] == answer.effects[0].parameters["extra"].value


def test_the_file_has_as_much_of_what_was_fitted_as_is_kept(answer: Diagnosis, robot: Robot) -> None:
    some = replace(answer, kept=Kept(*2 * (np.full(3, 0.5), np.full(3, 0.25)), 0.5, 0.25))
    whole, half = corrected_simulator(answer), corrected_simulator(some)
    extra = [each.effects[0].values["extra"] for each in (whole, half)]
    assert extra[1] == pytest.approx(0.25 * extra[0])
    base = base_parameters(robot.chain, tuple(GROUPS))
    fitted = answer.parameters_only[1].values[: PER_JOINT * robot.joints]
    halfway = base.values(robot.parameters + 0.5 * fitted)
    moved = base.values(reidentified_simulator(some).standard)
    assert np.abs(moved - halfway).max() < 0.05 * np.abs(halfway).max()
    none = replace(answer, kept=Kept(*np.zeros((4, 3)), 0.0, 0.0))
    assert corrected_simulator(none).effects == ()
    np.testing.assert_allclose(corrected_simulator(none).standard, robot.parameters, rtol=1e-3, atol=1e-4)


def test_the_error_of_the_file_is_said_beside_that_of_the_laws(answer: Diagnosis, tmp_path: Path) -> None:
    error = write_corrected(answer, tmp_path / "corrected.xml").error
    # The law has an exponent of one, and MuJoCo's Stribeck curve one of two.
    assert error.laws[LIFT] < error.file[LIFT] < 0.6 * error.given[LIFT]


def test_parameters_of_the_file_go_with_the_effects_that_it_has(robot: Robot, tmp_path: Path) -> None:
    """A spring that is fitted and not reported leaves its joint's weight to the parameters again."""
    wanted = [
        injection(robot, "stribeck_friction", "turn", {"extra": 6.0, "velocity": 0.1}),
        injection(robot, "gravity_spring", "lift", {"stiffness": 30.0, "phase": 0.3}),
    ]
    runs = simulated_runs(robot, wanted, 2)
    places = [("stribeck_friction", 0, None), ("gravity_spring", LIFT, None)]
    both = diagnosed(robot, runs, places)
    one = replace(both, effects=both.effects[:1])
    reported = {each.effect for each in one.effects}
    assert reported == {"stribeck_friction"}
    error = write_corrected(one, tmp_path / "corrected.xml").error
    refitted = diagnosed(robot, runs, places[:1])
    same = write_corrected(refitted, tmp_path / "refitted.xml").error
    np.testing.assert_allclose(error.file, same.file, rtol=0.05)
    assert error.file[LIFT] < 0.5 * error.given[LIFT]


def test_a_coupling_is_not_counted_twice(robot: Robot) -> None:
    """Each joint's own speed is in its viscous friction already, as far as the fit goes."""
    law = {"viscous": 3.0, "coulomb": 4.0}
    runs = simulated_runs(robot, [injection(robot, "joint_coupling", "turn", law, into="lift")], 2)
    found = corrected_simulator(diagnosed(robot, runs, [("joint_coupling", 0, 1)]))
    assert found.effects[0].values["viscous"] == pytest.approx(3.0, rel=0.05)
    viscous, own = (each.reshape(-1, PER_JOINT)[:, VISCOUS] for each in (found.standard, robot.parameters))
    np.testing.assert_allclose(viscous, own, rtol=0.1)


def test_closed_loop_gap_shrinks_with_the_effect(answer: Diagnosis, runs: dict[str, Recording]) -> None:
    gap = in_closed_loop(answer, {"run_3": runs["run_3"]})
    assert gap is not None
    assert not gap.failed
    assert gap.torque["effects"][LIFT] < 0.6 * gap.torque["parameters"][LIFT]
    assert gap.torque["effects"][LIFT] < 0.6 * gap.torque["nominal"][LIFT]


def test_no_closed_loop_without_a_known_controller(answer: Diagnosis, runs: dict[str, Recording]) -> None:
    assert in_closed_loop(answer, {"run_1": replace(runs["run_1"], controller=None)}) is None
    assert in_closed_loop(answer, {"run_1": replace(runs["run_1"], reference_position=None)}) is None
