"""The study of published models: how far each comes, and why not further."""

from pathlib import Path

import pytest

from identification.errors import InputError
from studies.robots.judge import Outcome, judge
from studies.robots.study import study, table
from testbench.files import write_json

STILL = '<robot name="still"><link name="base"/></robot>'


def test_a_model_that_is_no_robot_is_named_by_its_one_line(tmp_path: Path) -> None:
    (tmp_path / "still.urdf").write_text(STILL)
    outcome = judge(tmp_path / "still.urdf", "still.urdf", tmp_path / "work")
    assert (outcome.stopped, outcome.works, outcome.joints) == ("excite", False, 0)
    assert outcome.reason == "still.urdf: joint: expected at least one hinge or slide joint, got none"


@pytest.mark.parametrize(("left", "speed", "affected"), [(-1.0, 1.5, ()), (1.0, 0.75, ("payload",))])
def test_a_design_beyond_a_rated_speed_does_not_work_and_gets_no_effect(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, left: float, speed: float, affected: tuple[str, ...]
) -> None:
    def run(folder: Path, command: str, *arguments: object) -> str:
        out = Path(str(arguments[arguments.index("--out") + 1]))
        if command == "excite":
            speeds = {"peaks": {"velocity": [1.0, 3.0]}, "margins": {"velocity": [1.0, left]}}
            write_json({"joint_names": ["a", "b"], **speeds}, out)
        if command == "diagnose":
            out.mkdir()
            found = [{"effect": "payload", "joint": None, "probability": 0.9}] * ("affected" in str(out))
            write_json({"effects": found}, out / "diagnosis.json")
        return "arm.urdf: held still at zero, its mass counted: finger\nlimits kept yes\n"

    monkeypatch.setattr("studies.robots.judge._run", run)
    outcome = judge(tmp_path / "arm.urdf", "arm.urdf", tmp_path / "work")
    assert outcome.speed == speed
    assert outcome.works == (left > 0)
    assert (outcome.stopped, outcome.healthy, outcome.affected) == ("", (), affected)
    assert outcome.notes == ("arm.urdf: held still at zero, its mass counted: finger",)


def test_a_command_that_takes_too_long_is_ended_and_said(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def main(_: object) -> None:
        while True:
            pass

    monkeypatch.setattr("studies.robots.judge.main", main)
    monkeypatch.setattr("studies.robots.judge.PATIENCE", 0.05)
    outcome = judge(tmp_path / "arm.urdf", "arm.urdf", tmp_path / "work")
    assert (outcome.stopped, outcome.reason) == ("excite", "over 0.05 s of the processor")


def test_the_table_says_which_work_and_why_others_do_not() -> None:
    outcomes = [
        Outcome("a.urdf", joints=6, speed=0.9, notes=("a.urdf: meshes not found",), affected=("payload",)),
        Outcome("b.urdf", stopped="excite", reason="joint: got | none"),
        Outcome("c.urdf", joints=2, speed=0.5, healthy=("cable_spring j1",)),
    ]
    rows = table(outcomes).splitlines()[2:]
    assert rows == [
        "| a.urdf | 6 | yes | 90 | payload | meshes not found |",
        "| b.urdf |  | no |  |  | excite: joint: got / none |",
        "| c.urdf | 2 | no | 50 |  | healthy, but named: cable_spring j1 |",
    ]


def test_a_folder_without_models_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="a folder with URDF files in it"):
        study(tmp_path, tmp_path / "out")
