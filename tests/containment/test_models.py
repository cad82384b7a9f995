"""Models of strangers: bounded, checked, and compiled elsewhere first."""

import os
from pathlib import Path

import pytest

from identification.errors import InputError
from testbench.robot import load_robot

from ..small_arm import ARM

COPIES = (
    "<replicate count='{}' offset='1 0 0'><body><inertial pos='0 0 0' mass='1' diaginertia='1 1 1'/></body>"
)
BAD = {
    "a height field of 1e10 cells": (
        ARM.replace(
            "<worldbody>",
            "<asset><hfield name='h' nrow='100000' ncol='100000' size='1 1 1 1'/></asset>"
            "<worldbody><geom type='hfield' hfield='h'/>",
        ),
        "XML that MuJoCo loads",
    ),
    "copies": (
        ARM.replace("<worldbody>", "<worldbody>" + COPIES.format(10**5) + "</replicate>"),
        "at most 1000 copies",
    ),
    "copies of copies": (
        ARM.replace(
            "<worldbody>",
            "<worldbody>" + "<replicate count='100'>" * 2 + COPIES.format(9) + "</replicate>" * 3,
        ),
        "at most 1000 copies",
    ),
    "an arena": (
        ARM.replace("<worldbody>", "<size memory='3G'/><worldbody>"),
        "a model and a state of at most",
    ),
    "no number": (ARM.replace('armature=".1"', 'armature="nan"'), "dof_armature: expected finite numbers"),
    "no limit": (ARM.replace('"-30 30"', '"-30 nan"'), "jnt_actfrcrange: expected finite numbers"),
    "no UTF-8": (ARM.replace("small_arm", "sm\udce4ll"), "expected text in UTF-8"),
    "a command to a terminal": (ARM.replace('"elbow"', '"c&#27;[2J"'), "expected printable characters"),
    "depth": ("<mujoco>" + "<a>" * 200 + "</a>" * 200 + "</mujoco>", "nested elements"),
}


@pytest.mark.parametrize("kind", BAD)
def test_a_bad_model_is_one_line(kind: str, tmp_path: Path) -> None:
    text, says = BAD[kind]
    path = tmp_path / "arm.xml"
    path.write_bytes(text.encode("utf-8", "surrogateescape"))
    with pytest.raises(InputError, match=says) as error:
        load_robot(path)
    assert str(error.value).startswith(f"{path}: ")


def included(folder: Path, name: str) -> Path:
    path = folder / "arm.xml"
    path.write_text(ARM.replace("<worldbody>", f"<include file='{name}'/><worldbody>"))
    return path


def test_a_pipe_is_not_included(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.xml")
    with pytest.raises(InputError, match="include file: expected a regular file"):
        load_robot(included(tmp_path, "pipe.xml"))


def test_nothing_outside_the_folder_is_included(tmp_path: Path) -> None:
    (tmp_path / "model").mkdir()
    (tmp_path / "other.xml").write_text("<mujoco/>")
    with pytest.raises(InputError, match="a file below the model's folder"):
        load_robot(included(tmp_path / "model", "../other.xml"))


def test_what_lies_below_the_folder_is_included(tmp_path: Path) -> None:
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "option.xml").write_text("<mujoco><option timestep='0.001'/></mujoco>")
    assert load_robot(included(tmp_path, "parts/option.xml")).model.opt.timestep == 0.001
