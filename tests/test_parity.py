"""Torques of the regressor and of MuJoCo held against Pinocchio's, on a user's model."""

import sys
from pathlib import Path

import pytest

from testbench.cli import main
from testbench.jobs.parity import parity
from testbench.model_reading.reading import Choice
from testbench.robot import load_robot

from .small_arm import ARM

LINK = """<link name="{0}"><inertial><origin xyz=".1 .02 .03" rpy=".1 .2 .3"/><mass value="2"/>
  <inertia ixx=".02" iyy=".03" izz=".04" ixy=".001" ixz=".002" iyz="-.001"/></inertial></link>"""
JOINT = """<joint name="{0}" type="{1}"><parent link="{2}"/><child link="{3}"/>
  <origin xyz=".1 .2 .3" rpy=".4 .5 .6"/><axis xyz="0 .6 .8"/>
  <limit lower=".2" upper="1" effort="50" velocity="2"/>
  <dynamics damping=".5" friction=".3"/></joint>"""
# Two branches, a slide, and a joint that turns freely.
TREE = (
    "<robot name='tree'><link name='base'/>"
    + "".join(LINK.format(name) for name in "abcd")
    + JOINT.format("lift", "prismatic", "base", "a")
    + JOINT.format("turn", "continuous", "a", "b")
    + JOINT.format("left", "revolute", "b", "c")
    + JOINT.format("right", "revolute", "b", "d")
    + "</robot>"
)
TURNED = ARM.replace("<worldbody>", '<worldbody><body quat="0 1 0 0">').replace(
    "</worldbody>", "</body></worldbody>"
)


@pytest.mark.parametrize("joints", [None, ("shoulder",)])
def test_a_chain_agrees_with_pinocchio(tmp_path: Path, joints: tuple[str, ...] | None) -> None:
    (tmp_path / "arm.xml").write_text(ARM)
    found = parity(load_robot(tmp_path / "arm.xml", Choice(joints)), 20)
    assert found.sentence == "all three agree to rounding"
    assert found.torque.max() > 10


@pytest.mark.parametrize("joints", [None, ("lift", "turn", "right"), ("left", "right")])
def test_a_tree_agrees_with_pinocchio_joints_held_or_not(
    tmp_path: Path, joints: tuple[str, ...] | None
) -> None:
    (tmp_path / "tree.urdf").write_text(TREE)
    found = parity(load_robot(tmp_path / "tree.urdf", Choice(joints)), 20)
    assert max(found.regressor.value, found.mujoco.value) < 1e-9
    assert found.torque.max() > 1


def test_the_largest_differences_are_printed_with_their_joints(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "turned.xml"
    path.write_text(TURNED)
    main(["parity", "--model", str(path)])
    out = capsys.readouterr().out
    assert "regressor from Pinocchio" in out
    assert "N·m at shoulder" in out
    assert "Pinocchio reads this file otherwise" in out


def test_without_pinocchio_one_line_says_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "arm.xml").write_text(ARM)
    monkeypatch.setitem(sys.modules, "pinocchio", None)
    with pytest.raises(SystemExit) as ended:
        main(["parity", "--model", str(tmp_path / "arm.xml")])
    assert ended.value.code == 2
    assert "identification-testbench[parity]" in capsys.readouterr().err
