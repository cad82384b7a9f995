"""The public functions on a robot that measures no torque: as the commands do it."""

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import plotly.graph_objects as go
import pytest

import testbench
from studies.drives.leg import KD, KP, TRUTH, recorded, written
from testbench.cli import main
from testbench.log import read_log, write_log


@dataclass(frozen=True)
class Worked:
    """A leg taken through the functions."""

    folder: Path
    robot: testbench.Robot
    runs: dict[str, testbench.Recording]
    found: testbench.DriveEstimate
    why: testbench.DriveDiagnosis
    moved: testbench.PositionPrediction


@pytest.fixture(scope="module")
def worked(tmp_path_factory: pytest.TempPathFactory) -> Worked:
    folder = tmp_path_factory.mktemp("drives")
    model = written(folder)
    for seed, name in ((0, "one"), (1, "two")):
        write_log(recorded(model, seed=seed), folder / f"{name}.h5")
    robot = testbench.load_robot(model)
    runs = testbench.read_logs([folder / "one.h5", folder / "two.h5"], robot, torque=False)
    one, two = ({name: runs[name]} for name in ("one", "two"))
    found = testbench.identify(robot, one, two, drive="position_servo")
    why = testbench.diagnose(robot, one, drive="position_servo")
    return Worked(folder, robot, runs, found, why, testbench.predict(found, runs["two"]))


def test_the_estimate_is_that_of_the_command_line(worked: Worked, tmp_path: Path) -> None:
    logs = [str(worked.folder / "one.h5"), "--validate", str(worked.folder / "two.h5")]
    main(["identify", "--model", str(worked.folder / "leg.xml"), *logs, "--out", str(tmp_path / "found")])
    testbench.export(worked.found, tmp_path / "exported")
    estimates = [tmp_path / name / "estimate.json" for name in ("found", "exported")]
    assert estimates[0].read_text() == estimates[1].read_text()


def test_the_diagnosis_is_that_of_the_command_line(worked: Worked, tmp_path: Path) -> None:
    log, model = str(worked.folder / "one.h5"), str(worked.folder / "leg.xml")
    main(["diagnose", "--model", model, log, "--out", str(tmp_path / "why")])
    testbench.export(worked.why, tmp_path / "exported")
    documents = [json.loads((tmp_path / name / "diagnosis.json").read_text()) for name in ("why", "exported")]
    assert documents[0] == documents[1]
    assert worked.why.sentence == documents[0]["sentence"]


def test_a_stated_drive_and_its_file_are_one(worked: Worked, tmp_path: Path) -> None:
    path = tmp_path / "drive.yaml"
    path.write_text("kind: position_servo\nkp: 20\nkd: 1\ndelay: [0, 0.05]\n")
    stated = testbench.StatedDrive(kp=20, kd=1, delay=(0, 0.05))
    one = {"one": worked.runs["one"]}
    both = [testbench.identify(worked.robot, one, drive=each, fit_share=0.5) for each in (stated, path)]
    assert both[0].figures == both[1].figures
    assert [each.role for each in both[0].details.errors] == ["fit", "validation"]
    for figure in both[0].figures:
        if figure.name in ("armature", "coulomb"):
            truth = TRUTH[figure.name][worked.robot.joint_names.index(figure.joint)]
            assert abs(figure.value - truth) < 3 * figure.std


def test_a_prediction_by_the_folder_is_that_of_the_result(worked: Worked, tmp_path: Path) -> None:
    testbench.export(worked.found, tmp_path / "found")
    again = testbench.predict(tmp_path / "found", worked.runs["two"])
    assert isinstance(again, testbench.PositionPrediction)
    assert np.array_equal(again.position, worked.moved.position)
    assert np.sqrt(np.mean((again.position - worked.runs["two"].position) ** 2)) < 1e-3
    testbench.export(again, tmp_path / "moved.h5")
    assert np.array_equal(read_log(tmp_path / "moved.h5").torque, again.torque)


@pytest.mark.parametrize("name", ["found", "why", "moved"])
def test_results_show_a_table_and_a_plot(worked: Worked, name: str) -> None:
    result = getattr(worked, name)
    assert result._repr_html_().count("<table>") == 1
    figure = result.plot()
    assert isinstance(figure, go.Figure)
    assert len(figure.data) >= 2


def test_models_are_written_with_servos(worked: Worked, tmp_path: Path) -> None:
    for result, name in ((worked.found, "found.xml"), (worked.why, "why.xml")):
        testbench.export(result, tmp_path / name)
        assert "<general" in (tmp_path / name).read_text()


def test_options_of_torque_are_refused_beside_a_drive(worked: Worked) -> None:
    options = {"drive": testbench.StatedDrive(kp=tuple(KP), kd=tuple(KD))}
    with pytest.raises(testbench.InputError, match="runs with torque"):
        testbench.identify(worked.robot, worked.runs, estimator="irls", **options)
    with pytest.raises(testbench.InputError, match="cutoff"):
        testbench.diagnose(worked.robot, worked.runs, cutoff=20.0, **options)
    with pytest.raises(testbench.InputError, match="fit_share"):
        testbench.identify(worked.robot, worked.runs, fit_share=0.5)
