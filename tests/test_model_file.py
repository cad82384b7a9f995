import numpy as np
import pytest

from identification.errors import InputError
from testbench.model_file import write_model
from testbench.robot import load_robot

from .synthetic import ARM

ODD = """
<mujoco model="odd">
  <compiler angle="degree" inertiafromgeom="true" boundmass="0.1" balanceinertia="true"/>
  <default><joint armature="0.3" damping="2"/><geom density="500"/></default>
  <worldbody>
    <body name="base" pos="0 0 .1">
      <geom size=".1"/>
      <frame pos="0 .1 .2" euler="0 0 90">
        <body name="a" pos=".1 .2 .3">
          <frame pos=".1 0 0"><joint name="first" axis="0 1 0" pos=".05 .1 0" ref="20"/></frame>
          <geom type="box" size=".1 .2 .3" pos=".1 0 .1"/>
          <body name="welded" pos="0 .3 0">
            <geom type="capsule" size=".05 .2"/>
            <frame euler="0 90 0">
              <body pos="0 0 .4">
                <joint type="slide" axis="1 0 0" armature="3"/>
                <geom type="box" size=".1 .1 .3"/>
              </body>
            </frame>
          </body>
        </body>
      </frame>
    </body>
  </worldbody>
</mujoco>
"""
# One pixel.
PICTURE = bytes.fromhex(
    "89504e470d0a1a0a0000000d4948445200000001000000010802000000907753de0000000c49444154789c63686868000003"
    "0401814bd3d2100000000049454e44ae426082"
)
TWO_IN_ONE = """
<mujoco><worldbody><body>
  <joint axis="1 0 0"/><joint axis="0 1 0"/><geom size=".1"/>
</body></worldbody></mujoco>
"""


def _model(tmp_path, text):
    path = tmp_path / "model.xml"
    path.write_text(text)
    return path


def _scaled(robot):
    factors = np.random.default_rng(0).uniform(0.7, 1.4, (robot.joints, 1))
    return (robot.parameters.reshape(robot.joints, -1) * factors).ravel()


@pytest.mark.parametrize("name", ["tx90", "rail_arm", "hinges_and_slide", "odd"])
def test_written_parameters_come_back(name, models, tmp_path):
    texts = {"hinges_and_slide": ARM, "odd": ODD}
    robot = load_robot(_model(tmp_path, texts[name]) if name in texts else models / f"{name}.xml")
    standard = _scaled(robot)
    written = tmp_path / "elsewhere" / "identified.xml"
    write_model(robot, standard, written)
    again = load_robot(written)
    assert np.abs(again.parameters - standard).max() < 1e-12 * np.abs(standard).max()
    # MuJoCo writes six digits of the geometry.
    assert np.abs(again.chain.rotation - robot.chain.rotation).max() < 1e-5
    assert np.abs(again.chain.translation - robot.chain.translation).max() < 1e-5
    assert again.limits.torque == pytest.approx(robot.limits.torque, rel=1e-5)


def _with_a_mesh(tmp_path):
    meshes = tmp_path / "assets"
    meshes.mkdir()
    corners = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)]
    faces = [(1, 3, 2), (1, 2, 4), (1, 4, 3), (2, 3, 4)]
    lines = [f"v {x} {y} {z}" for x, y, z in corners] + [f"f {a} {b} {c}" for a, b, c in faces]
    (meshes / "fin.obj").write_text("\n".join(lines))
    text = ARM.replace('<mesh name="fin" vertex="0 0 0  .2 0 0  0 .2 0  0 0 .2"/>', '<mesh file="fin.obj"/>')
    text = text.replace('angle="radian"', 'angle="radian" meshdir="assets"')
    return load_robot(_model(tmp_path, text))


def test_a_written_model_takes_its_meshes_along(tmp_path):
    robot = _with_a_mesh(tmp_path)
    written = tmp_path / "far" / "away" / "identified.xml"
    write_model(robot, robot.parameters, written)
    (tmp_path / "assets" / "fin.obj").unlink()
    written.parent.rename(tmp_path / "moved")
    moved = tmp_path / "moved" / "identified.xml"
    again = load_robot(moved)
    assert again.model.nmesh == 1
    # A model that was written once is written again with the same file.
    write_model(again, again.parameters, tmp_path / "third" / "identified.xml")
    names = [
        sorted(each.name for each in (tmp_path / folder / "identified_files").iterdir())
        for folder in ("moved", "third")
    ]
    assert names[0] == names[1]


def test_a_model_that_is_not_written_leaves_no_files(tmp_path):
    robot = _with_a_mesh(tmp_path)
    impossible = robot.parameters.copy()
    impossible[:6] *= -1
    with pytest.raises(InputError, match="parameters that MuJoCo accepts"):
        write_model(robot, impossible, tmp_path / "out" / "identified.xml")
    assert list((tmp_path / "out").iterdir()) == []


def test_a_picture_from_elsewhere_is_not_carried_off(tmp_path):
    (tmp_path / "in").mkdir()
    (tmp_path / "private.png").write_bytes(PICTURE)
    texture = '<asset><texture name="skin" type="2d" file="../private.png"/>'
    robot = load_robot(_model(tmp_path / "in", ARM.replace("<asset>", texture)))
    with pytest.raises(InputError, match="texture file: expected a file below the model's folder"):
        write_model(robot, robot.parameters, tmp_path / "out" / "identified.xml")
    assert list(tmp_path.glob("out/*")) == []


def test_what_mujoco_refuses_is_not_written(tmp_path):
    robot = load_robot(_model(tmp_path, ARM))
    impossible = robot.parameters.copy()
    impossible[:6] *= -1
    written = tmp_path / "identified.xml"
    with pytest.raises(InputError, match="parameters that MuJoCo accepts"):
        write_model(robot, impossible, written)
    assert not written.exists()


def test_inertia_between_joints_of_one_body_has_no_place(tmp_path):
    robot = load_robot(_model(tmp_path, TWO_IN_ONE))
    standard = robot.parameters.copy()
    write_model(robot, standard, tmp_path / "fine.xml")
    standard[9] = 1.0
    with pytest.raises(InputError, match="joints of one body"):
        write_model(robot, standard, tmp_path / "not.xml")
