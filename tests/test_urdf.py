"""URDFs as they come: packages, meshes, inertias, links without mass, elements given twice, xacro."""

import struct
from pathlib import Path

import numpy as np
import pytest

from identification.errors import InputError
from identification.parameters import PER_JOINT
from testbench.model_reading.packages import parse_packages
from testbench.model_reading.reading import Choice
from testbench.robot import Robot, load_robot

BODY = (
    '<inertial><origin xyz=".1 0 .02"/><mass value="2"/>'
    '<inertia ixx="{}" iyy=".02" izz=".02" ixy="0" ixz="0" iyz="0"/></inertial>'
)
GOOD = BODY.format(".01")
MESH = '<collision><geometry><mesh filename="{}"/></geometry></collision>'


def _urdf(upper: str = GOOD, lower: str = GOOD, extra: str = "") -> str:
    return f"""
<robot name="two"><link name="base"/><link name="upper">{upper}</link><link name="lower">{lower}</link>
  <joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 1 0"/>
    <limit lower="-1" upper="2" effort="40" velocity=".7"/></joint>
  <joint name="elbow" type="revolute"><parent link="upper"/><child link="lower"/>
    <origin xyz=".3 0 0"/><axis xyz="0 1 0"/><limit lower="-1" upper="2" effort="20" velocity="1.3"/></joint>
  {extra}
</robot>
"""


def _load(folder: Path, text: str, choice: Choice | None = None) -> Robot:
    path = folder / "arm.urdf"
    path.write_text(text)
    return load_robot(path, choice)


def _tetrahedron(path: Path) -> None:
    """A binary STL."""
    corners = np.array([[0, 0, 0], [0.1, 0, 0], [0, 0.1, 0], [0, 0, 0.1]])
    faces = [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)]
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("wb") as file:
        file.write(bytes(80) + struct.pack("<I", len(faces)))
        for face in faces:
            file.write(struct.pack("<12f", 0, 0, 0, *corners[list(face)].ravel()) + bytes(2))


@pytest.mark.parametrize("way", ["above", "option", "ROS_PACKAGE_PATH", "AMENT_PREFIX_PATH"])
def test_meshes_of_packages_are_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, way: str) -> None:
    text = _urdf(upper=GOOD + MESH.format("package://arm_description/meshes/link.stl"))
    folder = tmp_path / "elsewhere"
    folder.mkdir()
    package, choice = tmp_path / "packages" / "arm_description", None
    if way == "above":
        package = tmp_path / "arm_description"
        folder = package / "urdf"
        folder.mkdir(parents=True)
    elif way == "option":
        package.mkdir(parents=True)
        choice = Choice(packages=parse_packages((f"arm_description={package}",)))
    elif way == "AMENT_PREFIX_PATH":
        package = tmp_path / "share" / "arm_description"
        monkeypatch.setenv(way, str(tmp_path))
    else:
        monkeypatch.setenv(way, str(package.parent))
    _tetrahedron(package / "meshes" / "link.stl")
    robot = _load(folder, text, choice)
    assert robot.model.nmesh == 1
    assert robot.notes == ()


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("package://nowhere/link.stl", "meshes not found (package://nowhere/link.stl; --package NAME=PATH"),
        ("link.dae", "meshes of a format that MuJoCo does not read (link.dae)"),
        ("broken.stl", "meshes that MuJoCo cannot read (broken.stl)"),
    ],
)
def test_a_mesh_that_cannot_be_had_is_left_out_with_a_line(tmp_path: Path, name: str, says: str) -> None:
    (tmp_path / "link.dae").write_text("<COLLADA/>")
    (tmp_path / "broken.stl").write_bytes(b"solid nothing")
    robot = _load(tmp_path, _urdf(upper=GOOD + MESH.format(name)))
    (note,) = robot.notes
    assert note.startswith(says)
    assert note.endswith("left out of pictures and clearance, at upper")
    assert robot.model.ngeom == 0


def test_an_inertia_that_no_body_has_is_taken_as_the_nearest_with_a_line(tmp_path: Path) -> None:
    robot = _load(tmp_path, _urdf(upper=BODY.format(".06")))
    assert robot.notes == ("inertia that no body has, taken as the nearest that one can have: upper",)
    np.testing.assert_allclose(robot.model.body_mass[1:], 2)
    # Second moments (-.01, .03, .03) with the first raised to zero.
    np.testing.assert_allclose(np.sort(robot.model.body_inertia[1]), [0.03, 0.03, 0.06], atol=1e-6)


def test_a_thin_body_is_possible(tmp_path: Path) -> None:
    robot = _load(tmp_path, _urdf(upper=BODY.format(".04")))
    assert robot.notes == ()
    np.testing.assert_allclose(np.sort(robot.model.body_inertia[1]), [0.02, 0.02, 0.04], atol=1e-9)


def test_a_frame_without_mass_may_carry_links_or_be_a_tip(tmp_path: Path) -> None:
    tip = '<link name="tool"/><joint name="t" type="fixed"><parent link="lower"/><child link="tool"/></joint>'
    robot = _load(tmp_path, _urdf(upper="", extra=tip))
    table = robot.parameters.reshape(2, PER_JOINT)
    np.testing.assert_allclose(table[0], 0, atol=1e-11)
    assert table[1, 9] == pytest.approx(2, rel=1e-11)


def test_a_joint_that_moves_no_mass_says_which_link_lacks_it(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="inertial of lower: expected mass and inertia.*elbow moves"):
        _load(tmp_path, _urdf(lower=MESH.format("link.stl")))
    # Held still it needs none.
    robot = _load(tmp_path, _urdf(lower=""), Choice(joints=("shoulder",)))
    assert robot.joint_names == ("shoulder",)


def test_of_elements_given_twice_the_first_counts(tmp_path: Path) -> None:
    robot = _load(tmp_path, _urdf(upper=GOOD + GOOD.replace('value="2"', 'value="5"')))
    assert robot.notes == ("given twice, the first counts: inertial of upper",)
    assert robot.model.body_mass[1] == 2


def test_a_negative_mass_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="mass of upper: expected at least 0 kg, got -2"):
        _load(tmp_path, _urdf(upper=GOOD.replace('value="2"', 'value="-2"')))


def test_a_xacro_is_a_program_and_is_not_run(tmp_path: Path) -> None:
    path = tmp_path / "arm.urdf.xacro"
    path.write_text(_urdf())
    with pytest.raises(InputError, match=r"run xacro first \(xacro arm.urdf.xacro > arm.urdf\)"):
        load_robot(path)


def test_a_package_option_wants_a_folder(tmp_path: Path) -> None:
    for text in ("arm_description", f"arm_description={tmp_path / 'nowhere'}"):
        with pytest.raises(InputError, match="--package"):
            parse_packages((text,))
