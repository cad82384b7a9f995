"""Recordings on the command line: imported, and given to the other commands as they are."""

import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from testbench.cli import main
from testbench.drive import Drive
from testbench.log import Recording, read_log, write_log
from testbench.robot import Robot

from ..one_line import complaint


def write_csv(recording: Recording, path: Path, **others: np.ndarray) -> None:
    """The run as a CSV of its joints' names, every digit kept."""
    channels = {"position": recording.position} | others
    header = ["time", *(f"{joint}_{name}" for name in channels for joint in recording.joint_names)]
    table = np.column_stack([recording.time, *channels.values()])
    np.savetxt(path, table, "%.17g", ",", header=",".join(header), comments="")


@pytest.fixture
def place(
    arm: Robot, healthy_runs: Mapping[str, Recording], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Path:
    """A folder to stand in: the arm, two runs as robot-logs and the same runs as CSV."""
    (tmp_path / "arm.xml").symlink_to(arm.path)
    for name in ("run_1", "run_2"):
        run = healthy_runs[name]
        write_log(run, tmp_path / f"{name}.h5")
        write_csv(run, tmp_path / f"{name}.csv", torque=run.torque)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_identify_takes_a_csv_as_it_takes_the_log_of_the_same_run(
    place: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    for suffix in ("h5", "csv"):
        main(f"identify --model arm.xml run_1.{suffix} --validate run_2.{suffix} --out {suffix}".split())
    lines = capfd.readouterr().out.splitlines()
    log, csv = (json.loads((place / name / "estimate.json").read_text()) for name in ("h5", "csv"))
    assert csv["base_parameters"] == log["base_parameters"]
    assert csv["torque_rms"] == log["torque_rms"]
    guessed = [line for line in lines if "guessed" in line]
    assert guessed == [
        "run_1.csv: guessed time time in s, position shoulder_position … elbow_position in rad, "
        "torque shoulder_torque … elbow_torque in N·m"
    ]
    assert lines[lines.index(guessed[0]) + 1].startswith(
        "  wrong? testbench import run_1.csv --model arm.xml"
    )


def test_import_writes_the_log_and_the_map_that_is_used_from_then_on(
    place: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    main(["import", "run_1.csv", "--model", "arm.xml", "--out", "new.h5"])
    assert "peaks are" in capfd.readouterr().out
    written, log = read_log("new.h5"), read_log("run_1.h5")
    np.testing.assert_array_equal(written.position, log.position)
    np.testing.assert_array_equal(written.torque, log.torque)
    text = (place / "new.map.yaml").read_text()
    (place / "new.map.yaml").write_text(text.replace("unit: N·m", "unit: mN·m"))
    main(["import", "run_1.csv", "--model", "arm.xml", "--out", "new.h5"])
    assert "read by new.map.yaml" in capfd.readouterr().out
    np.testing.assert_allclose(read_log("new.h5").torque, 1e-3 * log.torque)


def test_a_folder_of_runs_by_one_map(place: Path, capfd: pytest.CaptureFixture[str]) -> None:
    main(["import", "run_1.csv", "run_2.csv", "--model", "arm.xml", "--out", "logs"])
    assert sorted(path.name for path in Path("logs").iterdir()) == [
        "recordings.map.yaml",
        "run_1.h5",
        "run_2.h5",
    ]
    capfd.readouterr()
    main(["import", "run_1.csv", "run_2.csv", "--map", "logs/recordings.map.yaml", "--out", "again"])
    assert sorted(path.name for path in Path("again").iterdir()) == ["run_1.h5", "run_2.h5"]
    np.testing.assert_array_equal(read_log("again/run_2.h5").torque, read_log("run_2.h5").torque)


def test_a_robot_log_is_given_another_order_of_its_joints(
    place: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    log = read_log("run_1.h5")
    swapped = replace(
        log, joint_names=log.joint_names[::-1], position=log.position[:, ::-1], torque=log.torque[:, ::-1]
    )
    write_log(swapped, "swapped.h5")
    main(["import", "swapped.h5", "--model", "arm.xml", "--out", "back.h5"])
    np.testing.assert_array_equal(read_log("back.h5").position, log.position)
    assert read_log("back.h5").joint_names == log.joint_names


def test_what_lacks_torque_is_said_and_what_would_do(place: Path, capfd: pytest.CaptureFixture[str]) -> None:
    run = read_log("run_1.h5")
    write_csv(run, place / "motion.csv", target_position=run.position + 0.01)
    line = complaint("identify --model arm.xml motion.csv --out d", capfd)
    assert line == (
        "motion.csv: joint/torque: expected measured torque, or a current, duty or voltage with its "
        "constant (torque_constant or the drive's torque_per_unit in a map), got none, but reference "
        "positions\n"
    )
    with pytest.raises(SystemExit) as exit_:
        main(["import", "motion.csv", "--model", "arm.xml", "--out", "motion.h5"])
    assert exit_.value.code == 2
    assert "controller: {kp: ..., kd: ...} in motion.map.yaml" in capfd.readouterr().err
    assert not Path("motion.h5").exists()
    text = (place / "motion.map.yaml").read_text() + "controller: {kp: 100, kd: 5}\n"
    (place / "motion.map.yaml").write_text(text)
    main(["import", "motion.csv", "--model", "arm.xml", "--out", "motion.h5"])
    log = read_log("motion.h5")
    assert log.controller is not None
    np.testing.assert_array_equal(log.controller.kp, [100, 100])
    capfd.readouterr()
    # No servo of these gains follows a command that is the motion itself, moved.
    main(["diagnose", "--model", "arm.xml", "motion.h5", "--out", "d"])
    assert "the stated servo is not what moved it" in " ".join(capfd.readouterr().out.split())
    document = json.loads(Path("d", "diagnosis.json").read_text())
    assert (document["verdict"], document["effects"]) == ("unknown", [])


def test_a_signed_current_with_its_constant_is_torque(place: Path, capfd: pytest.CaptureFixture[str]) -> None:
    run = read_log("run_1.h5")
    drive = Drive("current", np.array([20.0, 10.0]))
    driven = replace(run, torque=np.full_like(run.torque, np.nan), current=run.torque / [20, 10], drive=drive)
    write_log(driven, "driven.h5")
    main(["identify", "--model", "arm.xml", "driven.h5", "--out", "d"])
    assert "driven.h5: no torque was measured: it is the current times" in capfd.readouterr().out
    main(["identify", "--model", "arm.xml", "run_1.h5", "--out", "e"])
    values = [
        [each["value"] for each in json.loads(Path(name, "estimate.json").read_text())["base_parameters"]]
        for name in ("d", "e")
    ]
    np.testing.assert_allclose(*values, rtol=1e-6, atol=1e-9)
    write_log(replace(driven, unsigned=("current",), drive=Drive("current")), "unsigned.h5")
    capfd.readouterr()
    line = complaint("identify --model arm.xml unsigned.h5 --out d", capfd)
    assert "got none, but current without its sign, no torque constant of every joint" in line


REFUSED = [
    ("import nothing.csv --out a.h5", "nothing.csv: log: expected an existing recording, got no such file"),
    (
        "import run_1.csv run_2.csv --out a.h5 --map none.yaml",
        "none.yaml: mapping: expected an existing YAML",
    ),
    ("import arm.xml --out a.h5", "arm.xml: log: expected a recording"),
    ("import run_1.csv --model arm.xml --out run_1.csv", "another file than those that are read"),
]


@pytest.mark.parametrize(("arguments", "says"), REFUSED, ids=[arguments for arguments, _ in REFUSED])
def test_bad_input_is_refused_in_one_line(
    place: Path, arguments: str, says: str, capfd: pytest.CaptureFixture[str]
) -> None:
    assert says in complaint(arguments, capfd)


@pytest.fixture
def on_wheels(place: Path) -> Path:
    """The arm's file, with a wheel before its own joints that no log has."""
    wheel = (
        '<worldbody><body pos="1 0 0"><joint name="wheel" axis="0 0 1"/>'
        '<inertial pos="0 0 0" mass="1" diaginertia=".1 .1 .1"/></body>'
    )
    path = place / "on_wheels.xml"
    text = (place / "arm.xml").read_text().replace("<worldbody>", wheel)
    path.write_text(text.replace('"4 4"', '"9 4 4"').replace('"30 40"', '"9 30 40"'))
    return path


@pytest.mark.parametrize("suffix", ["h5", "csv"])
def test_check_holds_the_joints_that_the_log_lacks(
    place: Path, on_wheels: Path, suffix: str, capfd: pytest.CaptureFixture[str]
) -> None:
    main(["check", f"run_1.{suffix}", "--model", on_wheels.name])
    said = capfd.readouterr().out
    assert "held still at zero, its mass counted: wheel" in said
    assert "2 joints" in said


def test_checks_for_machines_are_json_alone(place: Path, capfd: pytest.CaptureFixture[str]) -> None:
    main(["check", "run_1.csv", "--model", "arm.xml", "--json"])
    found = json.loads(capfd.readouterr().out)
    assert found["joint_names"] == ["shoulder", "elbow"]
    assert "guessed" in found["notes"][0]


def test_columns_are_known_by_the_model_s_names_where_these_have_numbers(
    place: Path, on_wheels: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """Without the model, arm_1_joint_position is of a joint called arm_joint."""
    for path in (on_wheels, place / "run_1.csv"):
        text = path.read_text()
        path.write_text(text.replace("shoulder", "arm_1_joint").replace("elbow", "arm_2_joint"))
    main(["check", "run_1.csv", "--model", on_wheels.name])
    assert "arm_2_joint" in capfd.readouterr().out


def test_columns_without_names_need_the_joints_that_they_are_of(
    place: Path, on_wheels: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    text = Path("run_1.csv").read_text()
    Path("plain.csv").write_text(text.replace("shoulder", "joint_1").replace("elbow", "joint_2"))
    arguments = f"import plain.csv --model {on_wheels.name} --out plain.h5"
    line = complaint(arguments, capfd)
    assert "3 joints" in line
    assert "--joints" in line
    main([*arguments.split(), "--joints", "shoulder,elbow"])
    np.testing.assert_array_equal(read_log("plain.h5").position, read_log("run_1.h5").position)
