"""An MJCF whose meshes or textures are not there: its masses are read, its shapes are left out and named."""

from pathlib import Path

import pytest

from identification.errors import InputError
from testbench.robot import load_robot

ARM = """
<mujoco><compiler meshdir="parts"/>
  <asset><texture name="wood" type="2d" file="wood.png"/><material name="wooden" texture="wood"/>
    <mesh name="there" file="there.obj"/><mesh file="gone.stl"/><mesh file="broken.stl"/></asset>
  <worldbody><geom type="plane" size="1 1 1" material="wooden"/>
    <body name="upper"><joint name="lift" axis="0 1 0"/>{inertial}
      <geom name="case" type="mesh" mesh="gone"/><geom type="mesh" mesh="there"/>
      <body name="fore" pos="1 0 0"><joint name="fold" axis="0 1 0"/>
        <geom name="hook" type="mesh" mesh="broken" mass="0"/><geom name="ball" size=".1"/>
    </body></body></worldbody>
  <contact><pair geom1="case" geom2="ball"/></contact></mujoco>
"""
INERTIAL = '<inertial pos=".5 0 0" mass="3" diaginertia=".1 .1 .1"/>'
TETRAHEDRON = "v 0 0 0\nv .2 0 0\nv 0 .2 0\nv 0 0 .2\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"


def _write(folder: Path, inertial: str) -> Path:
    (folder / "parts").mkdir()
    (folder / "parts" / "there.obj").write_text(TETRAHEDRON)
    (folder / "parts" / "broken.stl").write_text("no mesh")
    (folder / "arm.xml").write_text(ARM.format(inertial=inertial))
    return folder / "arm.xml"


def test_what_cannot_be_read_is_left_out_by_name_and_the_rest_stays(tmp_path: Path) -> None:
    robot = load_robot(_write(tmp_path, INERTIAL))
    assert robot.notes == (
        "meshes that MuJoCo cannot read (broken.stl, gone.stl): left out of pictures and clearance, "
        "at fore, upper",
        "textures that MuJoCo cannot read (wood.png): left out",
    )
    assert robot.joint_names == ("lift", "fold")
    assert robot.model.body("upper").mass[0] == 3
    assert (robot.model.nmesh, robot.model.ngeom, robot.model.npair) == (1, 3, 0)


def test_a_mesh_that_a_mass_comes_of_is_not_left_out(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="mesh gone: expected its file, whose volume gives upper its mass"):
        load_robot(_write(tmp_path, ""))
