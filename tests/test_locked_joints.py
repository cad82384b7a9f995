"""Joints that are held still: the same torques as the whole model has with these joints held."""

from pathlib import Path

import mujoco
import numpy as np
import pytest

from identification.errors import InputError
from identification.inverse_dynamics import inverse_dynamics
from testbench.model_file import write_model
from testbench.model_reading.reading import Choice
from testbench.robot import Robot, load_robot

MASS = '<inertial pos=".05 .02 .1" mass="{}" fullinertia=".02 .03 .025 .002 .001 -.003"/>'
# Frames, angles of every kind, several joints on a body, a joint's ref, and a hand on the arm.
ARM = f"""
<mujoco model="arm"><compiler angle="degree" eulerseq="zyx"/>
  <worldbody>
    <frame pos=".1 .2 .3" euler="10 20 30">
      <body name="upper" pos="0 0 .2" euler="5 -15 25">{MASS.format(4)}
        <joint name="turn" axis="0 0 1" range="-170 170" actuatorfrcrange="-90 90"/>
        <joint name="lean" axis="1 1 0" pos="0 .1 0" ref="20" range="-90 120"/>
        <joint name="lift" type="slide" axis="0 1 2" range="-.5 .5"/>
        <body name="lower" pos=".3 0 .1" axisangle="1 2 3 40">{MASS.format(2)}
          <joint name="elbow" axis="0 1 0" pos=".02 0 0" range="-100 100"/>
          <body name="hand" pos=".2 0 0" quat="1 .2 .3 .4">{MASS.format(1)}
            <joint name="wrist" type="ball"/>
            <body name="left" pos="0 .05 0">{MASS.format(0.2)}
              <joint name="finger_1" type="slide" axis="0 1 0" range="0 .04"/>
              <geom name="pad" size=".01"/></body>
            <body name="right" pos="0 -.05 0">{MASS.format(0.2)}
              <joint name="finger_2" type="slide" axis="0 -1 0" range="0 .04"/></body>
            <site name="tip" pos=".1 0 0"/>
          </body>
        </body>
      </body>
    </frame>
    <body name="box" pos="2 0 0"><freejoint/><geom name="crate" size=".1"/></body>
    <camera name="watch" mode="targetbody" target="box"/>
  </worldbody>
  <contact><exclude body1="box" body2="hand"/><pair geom1="crate" geom2="pad"/></contact>
  <tendon>
    <fixed name="split"><joint joint="finger_1" coef=".5"/><joint joint="finger_2" coef=".5"/></fixed>
  </tendon>
  <equality><joint joint1="finger_1" joint2="finger_2"/></equality>
  <actuator><position name="servo" joint="elbow" kp="50" kv="3" forcerange="-30 30"/>
    <general name="grip" tendon="split" gainprm="100"/></actuator>
  <sensor><framepos objtype="site" objname="tip"/><jointpos joint="finger_1"/></sensor>
  <keyframe>
    <key name="other" qpos="0 0 0 0 1 0 0 0 .01 .01 2 0 0 1 0 0 0"/>
    <key name="home" qpos=".3 .5 .1 .4 .8 .6 0 0 .03 .02 2 0 0 1 0 0 0"/>
  </keyframe>
</mujoco>
"""
KEPT = ("turn", "lift", "elbow")
# Of the four joints c follows b.
CHAIN = f"""
<mujoco><compiler angle="radian"/><worldbody>
  <body>{MASS.format(3)}<joint name="a" axis="0 0 1" range="-2 2"/>
    <body pos=".1 0 0">{MASS.format(2)}<joint name="b" axis="0 1 0" range="-2 2"/>
      <body pos=".2 0 .1">{MASS.format(1)}<joint name="c" axis="1 0 0" range="-4 .5"/>
        <body pos=".1 .1 0">{MASS.format(1)}<joint name="d" axis="0 1 1" range="-2 2"/></body>
  </body></body></body></worldbody>
  <equality>{{}}<joint joint1="c" joint2="b" polycoef={{}}/></equality></mujoco>
"""
FINGERS = """
<robot name="gripper"><link name="base"/>
  {links}
  <joint name="arm" type="revolute"><parent link="base"/><child link="a"/><axis xyz="0 1 0"/>
    <limit lower="-1" upper="1" effort="9" velocity="1"/></joint>
  <joint name="left" type="revolute"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/>
    <limit lower=".2" upper="1" effort="9" velocity="1"/></joint>
  <joint name="right" type="revolute"><parent link="a"/><child link="c"/><axis xyz="0 0 1"/>
    <limit lower="-1" upper="1" effort="9" velocity="1"/><mimic joint="left" multiplier="-1"/></joint>
</robot>
"""
LINK = (
    '<link name="{}"><inertial><origin xyz=".1 .02 .03"/><mass value="{}"/>'
    '<inertia ixx=".01" iyy=".02" izz=".02" ixy=".001" ixz="0" iyz="0"/></inertial></link>'
)


def _written(folder: Path, text: str, name: str = "arm.xml") -> Path:
    path = folder / name
    path.write_text(text)
    return path


def _held_torques(path: Path, robot: Robot, qpos: np.ndarray, motion: np.ndarray) -> np.ndarray:
    """Torque (N, n) of the whole model by MuJoCo, all but the robot's joints held at ``qpos``."""
    whole = mujoco.MjModel.from_xml_path(str(path))
    whole.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT | mujoco.mjtDisableBit.mjDSBL_ACTUATION
    data = mujoco.MjData(whole)
    joints = [whole.joint(name) for name in robot.joint_names]
    torques = []
    for q, dq, ddq in zip(*motion, strict=True):
        data.qpos[:], data.qvel[:], data.qacc[:] = qpos, 0, 0
        for joint, position, speed, acceleration in zip(joints, q, dq, ddq, strict=True):
            data.qpos[joint.qposadr], data.qvel[joint.dofadr] = position, speed
            data.qacc[joint.dofadr] = acceleration
        mujoco.mj_inverse(whole, data)
        torques.append([data.qfrc_inverse[joint.dofadr[0]] for joint in joints])
    return np.array(torques)


def _motion(robot: Robot) -> np.ndarray:
    return np.random.default_rng(1).uniform(-0.4, 0.4, (3, 40, robot.joints))


def _torques(robot: Robot, motion: np.ndarray) -> np.ndarray:
    return inverse_dynamics(robot.chain, robot.parameters, *motion)


HOME = np.array([0.3, 0.5, 0.1, 0.4, 0.8, 0.6, 0, 0, 0.03, 0.02, 2, 0, 0, 1, 0, 0, 0])


def test_torques_are_those_of_the_whole_model_with_its_other_joints_at_home(tmp_path: Path) -> None:
    path = _written(tmp_path, ARM)
    robot = load_robot(path, Choice(("elbow", "turn", "lift")))
    assert robot.joint_names == KEPT
    motion = _motion(robot)
    expected = _held_torques(path, robot, HOME, motion)
    np.testing.assert_allclose(_torques(robot, motion), expected, rtol=0, atol=1e-9)


def test_it_is_said_what_was_held_and_ignored(tmp_path: Path) -> None:
    robot = load_robot(_written(tmp_path, ARM), Choice(KEPT))
    assert robot.notes == (
        "held still at keyframe home, its mass counted: lean, wrist, finger_1, finger_2",
        "ignored, free bodies: box",
    )


def test_without_names_all_but_the_gripper_moves(tmp_path: Path) -> None:
    # A ball joint is none that it could move.
    text = ARM.replace('<joint name="wrist" type="ball"/>', "").split("<keyframe>")[0] + "</mujoco>"
    robot = load_robot(_written(tmp_path, text))
    assert robot.joint_names == ("turn", "lean", "lift", "elbow")


def test_a_servos_force_is_the_torque_limit_and_no_reason_to_refuse(tmp_path: Path) -> None:
    robot = load_robot(_written(tmp_path, ARM), Choice(KEPT))
    np.testing.assert_array_equal(robot.limits.torque, [90, np.inf, 30])


def test_a_model_of_what_is_left_can_be_written_and_read(tmp_path: Path) -> None:
    path = _written(tmp_path, ARM)
    robot = load_robot(path, Choice(KEPT))
    write_model(robot, robot.parameters, tmp_path / "corrected.xml")
    again = load_robot(tmp_path / "corrected.xml")
    assert again.joint_names == KEPT
    motion = _motion(robot)
    # MuJoCo writes six digits.
    np.testing.assert_allclose(_torques(again, motion), _torques(robot, motion), rtol=0, atol=2e-4)


def test_names_that_the_model_has_not_are_refused_with_those_it_has(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"'knee'.*turn, lean, lift, elbow"):
        load_robot(_written(tmp_path, ARM), Choice(("turn", "knee")))


def test_a_tendon_between_a_joint_that_moves_and_one_that_is_held_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"all joints of a tendon with finger_1.*finger_2, held still"):
        load_robot(_written(tmp_path, ARM), Choice(("turn", "finger_1")))


def test_a_mimic_gripper_of_a_urdf_is_held_within_its_range(tmp_path: Path) -> None:
    links = "".join(LINK.format(name, mass) for name, mass in (("a", 3), ("b", 0.5), ("c", 0.4)))
    path = _written(tmp_path, FINGERS.format(links=links), "arm.urdf")
    robot = load_robot(path)
    assert robot.joint_names == ("arm",)
    assert robot.notes == ("held still at zero, its mass counted: left, right",)
    motion = _motion(robot)
    expected = _held_torques(path, robot, np.array([0, 0.2, 0]), motion)
    np.testing.assert_allclose(_torques(robot, motion), expected, rtol=0, atol=1e-9)


def test_a_gripper_whose_followers_the_file_has_fixed_is_held(tmp_path: Path) -> None:
    links = "".join(LINK.format(name, mass) for name, mass in (("a", 3), ("b", 0.5), ("c", 0.4)))
    fixed = FINGERS.replace('<joint name="right" type="revolute">', '<joint name="right" type="fixed">')
    robot = load_robot(_written(tmp_path, fixed.format(links=links), "arm.urdf"))
    assert robot.joint_names == ("arm",)
    assert robot.notes == ("held still at zero, its mass counted: left",)
    # Named, it moves.
    asked = load_robot(tmp_path / "arm.urdf", Choice(("arm", "left")))
    assert asked.joint_names == ("arm", "left")


@pytest.mark.parametrize("joints", [("arm", "left"), ("arm", "left", "right")])
def test_a_follower_moves_with_its_leader(tmp_path: Path, joints: tuple[str, ...]) -> None:
    links = "".join(LINK.format(name, mass) for name, mass in (("a", 3), ("b", 0.5), ("c", 0.4)))
    robot = load_robot(_written(tmp_path, FINGERS.format(links=links), "arm.urdf"), Choice(joints))
    assert robot.joint_names == ("arm", "left")
    assert robot.chain.link_names == ("arm", "left", "right")
    assert robot.notes == ("right moves with left, -1 times as far",)


def test_followers_of_followers_move_with_the_first(tmp_path: Path) -> None:
    chain = CHAIN.format("<joint joint1='b' joint2='a' polycoef='.1 2 0 0 0'/>", "'0 -3 0 0 0'")
    robot = load_robot(_written(tmp_path, chain))
    assert robot.joint_names == ("a", "d")
    assert robot.chain.followers is not None
    np.testing.assert_allclose(robot.chain.link_positions(np.array([0.5, 1.0])), [0.5, 1.1, -3.3, 1.0])


def test_a_coupling_stays_where_one_before_it_goes(tmp_path: Path) -> None:
    chain = CHAIN.format("<joint joint1='d' joint2='a' polycoef='0 1 0 0 0'/>", "'0 2 0 0 0'")
    robot = load_robot(_written(tmp_path, chain), Choice(("b",)))
    assert robot.chain.link_names == ("b", "c")


@pytest.mark.parametrize(
    ("polynomial", "reason"),
    [
        ("'0 2 .1 0 0'", ""),
        ("'3 1 0 0 0'", " as its range leaves b none"),
    ],
)
def test_a_follower_that_is_held_while_its_leader_moves_is_said(
    tmp_path: Path, polynomial: str, reason: str
) -> None:
    path = _written(tmp_path, CHAIN.format("", polynomial))
    robot = load_robot(path, Choice(("a", "b", "d")))
    assert robot.chain.followers is None
    cost = "b has its weight as it stands, and lacks its inertia and friction"
    assert f"c follows b, but is held still here{reason}: {cost}" in robot.notes


LEGGED = f"""
<mujoco><worldbody><body name="trunk" pos="0 0 1" quat="1 .1 0 0"><freejoint/>{MASS.format(9)}
  <body name="thigh"><joint name="hip" axis="0 1 0"/>{MASS.format(2)}
    <body name="shank" pos="0 0 -.3"><joint name="knee" axis="0 1 0"/>{MASS.format(1)}</body></body>
</body></worldbody></mujoco>
"""


def test_a_floating_base_is_held_where_its_joints_are_named_or_asked_to(tmp_path: Path) -> None:
    path = _written(tmp_path, LEGGED)
    for robot in (load_robot(path, Choice(("hip", "knee"))), load_robot(path, Choice(fix_base=True))):
        assert robot.joint_names == ("hip", "knee")
        assert "floating base held: trunk" in robot.notes
    motion = _motion(robot)
    expected = _held_torques(path, robot, np.array([0, 0, 1, 1, 0.1, 0, 0, 0, 0]), motion)
    np.testing.assert_allclose(_torques(robot, motion), expected, rtol=0, atol=1e-9)


def test_a_floating_base_that_nobody_said_to_hold_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"--fix-base holds it.*got trunk, which floats"):
        load_robot(_written(tmp_path, LEGGED))
