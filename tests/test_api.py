"""The public functions: as the commands, without a file of their own, and importable at once."""

import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import plotly.graph_objects as go
import pytest

import testbench
from testbench.cli import main
from testbench.log import read_log

from .small_arm import ARM

EFFECT = "transmission_ripple:elbow"
DESIGN = {"harmonics": 4, "base_frequency": 0.25, "starts": 1, "iterations": 20}


@dataclass(frozen=True)
class Worked:
    """A robot taken through all functions."""

    folder: Path
    robot: testbench.Robot
    motion: testbench.Motion
    runs: dict[str, testbench.Recording]
    found: testbench.IdentificationResult
    why: testbench.DiagnosisResult
    torque: testbench.Prediction


@pytest.fixture(scope="module")
def worked(tmp_path_factory: pytest.TempPathFactory) -> Worked:
    folder = tmp_path_factory.mktemp("api")
    (folder / "arm.xml").write_text(ARM)
    robot = testbench.load_robot(folder / "arm.xml")
    motion = testbench.excite(robot, **DESIGN)
    testbench.export(motion, folder / "motion.json")
    for seed, name in enumerate(("one", "two")):
        run = testbench.simulate(robot, motion, effects=[EFFECT], periods=1, seed=seed)
        testbench.export(run, folder / f"{name}.h5")
    runs = testbench.read_logs([folder / "one.h5", folder / "two.h5"], robot)
    found = testbench.identify(robot, {"one": runs["one"]}, {"two": runs["two"]})
    why = testbench.diagnose(robot, runs)
    testbench.export(why, folder / "why")
    return Worked(folder, robot, motion, runs, found, why, testbench.predict(why, runs["two"]))


def test_import_loads_nothing_heavy_and_leaves_the_environment_alone() -> None:
    program = (
        "import os, sys; before = dict(os.environ)\n"
        "from testbench import diagnose, excite, export, identify, load_robot, predict, read_logs, simulate\n"
        "heavy = {'numpy', 'scipy', 'numba', 'mujoco', 'h5py', 'plotly', 'rerun'} & set(sys.modules)\n"
        "from testbench import Recording, Robot\n"
        "assert dict(os.environ) == before and not heavy, heavy"
    )
    subprocess.run([sys.executable, "-c", program], check=True)


def test_functions_stay_what_they_are_when_their_work_has_been_loaded(worked: Worked) -> None:
    assert all(callable(getattr(testbench, name)) for name in ("excite", "simulate", "identify", "diagnose"))


def test_results_are_those_of_the_command_line(worked: Worked, tmp_path: Path) -> None:
    model, log = ["--model", str(worked.folder / "arm.xml")], str(tmp_path / "one.h5")
    motion = str(tmp_path / "motion.json")
    options = [f for name, value in DESIGN.items() for f in (f"--{name.replace('_', '-')}", str(value))]
    main(["excite", *model, "--out", motion, *options])
    assert Path(motion).read_text() == (worked.folder / "motion.json").read_text()
    main(["simulate", *model, "--trajectory", motion, "--effect", EFFECT, "--periods", "1", "--out", log])
    assert np.array_equal(read_log(log).torque, worked.runs["one"].torque)
    two = str(worked.folder / "two.h5")
    main(["identify", *model, log, "--validate", two, "--out", str(tmp_path / "found")])
    testbench.export(worked.found, tmp_path / "exported")
    estimates = [tmp_path / name / "estimate.json" for name in ("found", "exported")]
    assert estimates[0].read_text() == estimates[1].read_text()
    main(["diagnose", *model, log, two, "--out", str(tmp_path / "why")])
    for name in ("diagnosis.json", "corrected.xml"):
        written, exported = ((folder / "why" / name).read_text() for folder in (tmp_path, worked.folder))
        assert exported == written


def test_the_diagnosis_and_its_prediction_can_be_read(worked: Worked) -> None:
    assert [(each.effect, each.joint) for each in worked.why.effects] == [("transmission_ripple", 1)]
    measured = worked.torque.measured
    assert measured is not None
    error, before = (
        np.sqrt(np.mean((measured - each)[:, 1] ** 2))
        for each in (worked.torque.torque.corrected, worked.torque.torque.nominal)
    )
    assert error < 0.5 * before


def test_a_prediction_by_the_folder_is_that_of_the_result(worked: Worked, tmp_path: Path) -> None:
    again = testbench.predict(worked.folder / "why", worked.runs["two"])
    np.testing.assert_allclose(again.torque.corrected, worked.torque.torque.corrected, rtol=0, atol=1e-9)
    testbench.export(again, tmp_path / "torque.h5")
    assert np.array_equal(read_log(tmp_path / "torque.h5").torque, again.torque.corrected)


@pytest.mark.parametrize("name", ["robot", "motion", "found", "why", "torque"])
def test_results_show_a_table_of_escaped_text(worked: Worked, name: str) -> None:
    page = getattr(worked, name)._repr_html_()
    assert page.count("<tr>") >= 2
    assert page.count("<table>") == 1


@pytest.mark.parametrize("name", ["motion", "found", "why", "torque"])
def test_results_plot(worked: Worked, name: str) -> None:
    figure = getattr(worked, name).plot()
    assert isinstance(figure, go.Figure)
    assert len(figure.data) >= 2


def test_names_of_strangers_are_escaped(worked: Worked) -> None:
    run = worked.runs["one"]
    changed = testbench.Recording(**vars(run) | {"robot": "<script>", "joint_names": ("<b>", "&")})
    page = changed._repr_html_()
    assert "<script>" not in page
    assert "&lt;b&gt;" in page
    assert len(changed.plot().data) == 4


def test_exports_are_refused_under_another_ending(worked: Worked, tmp_path: Path) -> None:
    for result in (worked.motion, worked.runs["one"], worked.found, worked.why, worked.torque):
        with pytest.raises(testbench.InputError, match="ends in"):
            testbench.export(result, tmp_path / "result.txt")
    assert list(tmp_path.iterdir()) == []


def test_a_run_cannot_judge_itself(worked: Worked) -> None:
    with pytest.raises(testbench.InputError, match="not fitted"):
        testbench.identify(worked.robot, worked.runs, worked.runs)
