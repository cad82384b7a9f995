"""What a design may do: rated speeds of a model, and cautious ones where it states none."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from diagnosis.experiment.reached_limits import within_reach
from identification.errors import InputError
from identification.excitation.design import DesignOptions, random_excitation
from identification.excitation.random_motion import FeasibleMotions, resting_centres
from identification.excitation.trajectories import trajectory_basis
from testbench.clearance import clearance_of
from testbench.design_limits import CAUTIOUS_SLIDE, CAUTIOUS_SPEED, design_limits
from testbench.jobs.excite import CLEARANCE, design_room, excite_model
from testbench.robot import Robot, load_robot

INERTIAL = (
    '<inertial><origin xyz=".1 0 .02"/><mass value="2"/>'
    '<inertia ixx=".01" iyy=".02" izz=".02" ixy="0" ixz="0" iyz="0"/></inertial>'
)
URDF = f"""
<robot name="two">
  <link name="base"/>
  <link name="upper">{INERTIAL}</link>
  <link name="lower">{INERTIAL}</link>
  <joint name="shoulder" type="revolute">
    <parent link="base"/><child link="upper"/><axis xyz="0 1 0"/>
    <limit lower="-1" upper="2" effort="40" velocity=".7"/><dynamics damping=".5" friction=".2"/>
  </joint>
  <joint name="elbow" type="continuous">
    <parent link="upper"/><child link="lower"/><origin xyz=".3 0 0"/><axis xyz="0 1 0"/>
    <limit effort="20" velocity="1.3"/>
  </joint>
</robot>
"""
# Two balls that are 3 cm apart at most, and one that is far out.
BALLS = """
<mujoco><compiler angle="radian"/><worldbody><body name="upper">
  <joint axis="0 1 0" range="-1 1"/><geom type="sphere" size=".1" pos=".17 0 0"/>
  <body name="lower" pos=".3 0 0"><joint axis="0 0 1" range="-2 2"/>
    <inertial pos="0 0 0" mass="1" diaginertia=".01 .01 .01"/>
    <body name="hand" pos=".1 0 0"><joint axis="1 0 0" range="-1 1"/><geom type="sphere" size=".1"/>
      <geom type="sphere" size=".1" pos="2 0 0" name="tip"/>
    </body></body></body></worldbody></mujoco>
"""
# A ball on a rail between two walls: 2 cm from both in the middle, 8 cm from one at the other.
WALLS = """
<mujoco><worldbody>
  <geom name="left" type="box" size=".1 .1 .1" pos="-.22 0 0"/>
  <geom name="right" type="box" size=".1 .1 .1" pos=".22 0 0"/>
  <body name="cart"><joint name="rail" type="slide" axis="1 0 0" range="-.06 .06" actuatorfrcrange="-50 50"/>
    <inertial pos="0 0 0" mass="1" diaginertia=".01 .01 .01"/>
    <body name="ball"><joint name="spin" axis="1 0 0" range="-1 1" actuatorfrcrange="-5 5"/>
      <geom type="sphere" size=".1"/></body></body></worldbody></mujoco>
"""
QUICK = DesignOptions(harmonics=3, base_frequency=0.25, starts=1, iterations=4, limit_share=0.9)


def _robot(folder: Path, text: str, name: str = "arm.urdf") -> Robot:
    path = folder / name
    path.write_text(text)
    return load_robot(path)


def test_a_urdfs_rated_speeds_efforts_and_dynamics_are_read(tmp_path: Path) -> None:
    robot = _robot(tmp_path, URDF)
    np.testing.assert_array_equal(robot.limits.velocity, [0.7, 1.3])
    np.testing.assert_array_equal(robot.limits.torque, [40, 20])
    np.testing.assert_array_equal(robot.model.dof_frictionloss, [0.2, 0])
    np.testing.assert_array_equal(robot.limits.upper, [2, np.inf])
    assert np.all(np.isinf(robot.limits.acceleration))


def test_custom_numerics_inside_a_urdf_count(tmp_path: Path) -> None:
    custom = '<mujoco><custom><numeric name="acceleration_limit" data="3 5"/></custom></mujoco>'
    robot = _robot(tmp_path, URDF.replace('<link name="base"/>', f'{custom}<link name="base"/>'))
    np.testing.assert_array_equal(robot.limits.acceleration, [3, 5])
    np.testing.assert_array_equal(robot.limits.velocity, [0.7, 1.3])


def test_a_negative_rated_speed_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="limit velocity of shoulder"):
        _robot(tmp_path, URDF.replace('velocity=".7"', 'velocity="-1"'))


def test_a_design_keeps_a_urdfs_rated_speeds_and_prints_peaks_beside_limits(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "arm.urdf"
    path.write_text(URDF)
    found = excite_model(path, tmp_path / "motion.json", "logdet", QUICK, 1)
    assert np.all(found.margins.peaks.velocity <= [0.7, 1.3])
    np.testing.assert_allclose(found.margins.velocity + found.margins.peaks.velocity, [0.7, 1.3])
    printed = capsys.readouterr().out
    assert "no range in the model: ±π for elbow" in printed
    (row,) = [line.split() for line in printed.splitlines() if line.startswith("shoulder")]
    assert row[1:7:2] == [f"{float(peak[0]):.3g}" for peak in vars(found.margins.peaks).values()]
    assert row[2:7:2] == ["0.7", "–", "40"]


def test_a_range_without_an_end_is_none(tmp_path: Path) -> None:
    limit = '<limit lower="-1e16" upper="1e+16" '
    robot = _robot(tmp_path, URDF.replace('<limit lower="-1" upper="2" ', limit))
    assert robot.limits.upper[0] == np.inf


def test_what_a_model_does_not_rate_is_cautious_or_as_asked_and_said(tmp_path: Path) -> None:
    robot = _robot(tmp_path, URDF.replace('velocity=".7"', "").replace('effort="40"', ""))
    found = design_limits(robot)
    np.testing.assert_array_equal(found.limits.velocity, [CAUTIOUS_SPEED, 1.3])
    assert np.isfinite(found.limits.acceleration).tolist() == [True, False]
    assert any(
        "1 rad/s (a cautious default, --velocity-limit sets it) for shoulder" in s for s in found.assumed
    )
    np.testing.assert_array_equal(design_limits(robot, 2.5).limits.velocity, [2.5, 1.3])
    with pytest.raises(InputError, match="velocity limit"):
        design_limits(robot, 0.0)


def test_a_slide_without_a_rated_speed_moves_at_the_reduced_speed(tmp_path: Path) -> None:
    rail = URDF.replace('type="revolute"', 'type="prismatic"').replace('velocity=".7"', "")
    assert design_limits(_robot(tmp_path, rail)).limits.velocity[0] == CAUTIOUS_SLIDE


def test_a_pair_that_is_hardly_ever_clear_is_kept_half_as_far_apart_as_it_can_be(tmp_path: Path) -> None:
    robot = _robot(tmp_path, BALLS, "arm.xml")
    clearance, notes = clearance_of(robot, 0.05)
    assert clearance is not None
    assert clearance.pairs == ("upper and hand", "upper and tip")
    assert notes == ("hardly ever 0.05 m apart, so kept half as far apart as they can be: upper and hand",)
    # 3 cm apart at zero; as far apart as they can be counts what nine of ten poses do not exceed.
    assert 0.03 - 0.015 < clearance.distances(np.zeros((1, 3)))[0, 0] - 0.05 < 0.03 - 0.012
    assert clearance_of(robot, 0.01)[1] == ()


def test_a_pair_that_is_clear_in_few_poses_is_kept_out_of_all_others(tmp_path: Path) -> None:
    # Clear by half a millimetre, where the elbow is stretched to within a tenth of its range.
    robot = _robot(tmp_path, BALLS.replace('pos=".17 0 0"', 'pos=".1995 0 0"'), "arm.xml")
    clearance, _ = clearance_of(robot, 0.01)
    assert clearance is not None
    assert clearance.pairs == ("upper and hand", "upper and tip")
    stretched, bent = clearance.distances(np.array([[0, 0, 0], [0, 0.5, 0]]))[:, 0]
    assert bent < clearance.required < stretched


def test_a_pair_that_overlaps_is_dropped_by_name(tmp_path: Path) -> None:
    robot = _robot(tmp_path, BALLS.replace('pos=".17 0 0"', 'pos=".3 0 0"'), "arm.xml")
    clearance, notes = clearance_of(robot, 0.01)
    assert clearance is not None
    assert clearance.pairs == ("upper and tip",)
    assert notes == ("in touch in every pose, so not kept apart: upper and hand",)


def test_shapes_that_meet_at_a_joint_are_dropped_by_name(tmp_path: Path) -> None:
    # Never further apart than 0.1 mm, as meshes of neighbouring phalanges are.
    robot = _robot(tmp_path, BALLS.replace('pos=".17 0 0"', 'pos=".1999 0 0"'), "arm.xml")
    clearance, notes = clearance_of(robot, 0.01)
    assert clearance is not None
    assert clearance.pairs == ("upper and tip",)
    assert notes == ("in touch in every pose, so not kept apart: upper and hand",)


def test_a_robot_that_cannot_rest_in_the_middle_rests_where_it_can(tmp_path: Path) -> None:
    weak = (
        '<mujoco><compiler angle="radian"/><worldbody><body><joint axis="0 1 0" range="-1.2 1.2" '
        'actuatorfrcrange="-1.2 1.2"/><inertial pos=".1 0 0" mass="2" diaginertia=".01 .02 .02"/>'
        "</body></worldbody></mujoco>"
    )
    robot = _robot(tmp_path, weak, "arm.xml")
    centres = resting_centres(robot.chain, robot.parameters, robot.limits, None, 0)
    # Its weight takes 1.962 N·m cos q.
    lowest = np.arccos(1.2 / (2 * 9.81 * 0.1))
    assert 0.6 < lowest <= np.abs(centres).min() < lowest + 0.01
    assert np.abs(centres).max() < 1.2


def test_a_clearance_that_no_pose_has_is_lowered_and_said_unless_it_was_asked_for(tmp_path: Path) -> None:
    # The far ball is between 2 and 4 cm from a wall, where the near pair needs no room.
    robot = _robot(tmp_path, WALLS, "arm.xml")
    room = design_room(robot, 0.9)
    assert room.clearance is not None
    assert room.clearance.required == CLEARANCE / 2
    assert room.notes[-1] == "hardly ever clear by 0.03 m: parts are kept 0.015 m apart (--clearance)"
    asked = design_room(robot, 0.9, clearance=CLEARANCE)
    with pytest.raises(InputError, match="clearance of"):
        random_excitation(robot.chain, robot.parameters, asked.limits, QUICK, asked.clearance)


def test_the_next_experiment_is_no_faster_than_the_runs_where_no_speed_is_rated(tmp_path: Path) -> None:
    class Run:
        q = dq = ddq = tau = np.linspace(-0.4, 0.4, 5)[:, None] * np.ones(2)

    robot = _robot(tmp_path, URDF)
    limits = replace(robot.limits, velocity=np.array([0.7, np.inf]), lower=-np.ones(2), upper=np.ones(2))
    found, filled = within_reach(limits, [Run()])  # type: ignore[list-item]  # what it reads of a run
    assert filled
    np.testing.assert_allclose(found.velocity, [0.7, 0.4], rtol=1e-3)
    np.testing.assert_array_equal(found.torque, [40, 20])


class _Tight:
    """Two pairs; the second is clear at one configuration alone."""

    required, pairs = 0.01, ("hand and post", "hand and wall")

    def distances(self, q: np.ndarray) -> np.ndarray:
        return np.column_stack([np.ones(len(q)), 0.02 - 100 * np.abs(q).max(axis=1)])

    def gradients(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        raise NotImplementedError


def test_where_nothing_can_move_the_line_names_what_is_in_the_way(tmp_path: Path) -> None:
    robot = _robot(tmp_path, URDF)
    limits = replace(robot.limits, acceleration=np.full(2, 20.0), lower=-np.ones(2), upper=np.ones(2))
    basis, centres = trajectory_basis("fourier", 0.2, 3), np.zeros((1, 2))
    motions = FeasibleMotions(robot.chain, robot.parameters, limits, basis, _Tight(), centres)
    with pytest.raises(InputError, match="clearance of hand and wall: .* a smaller --clearance"):
        motions.draw(np.random.default_rng(0))
    weak = replace(limits, torque=np.array([1e-3, 20.0]))
    motions = FeasibleMotions(robot.chain, robot.parameters, weak, basis, None, centres)
    with pytest.raises(InputError, match="torque limit of shoulder: .* joints held still"):
        motions.draw(np.random.default_rng(0))
