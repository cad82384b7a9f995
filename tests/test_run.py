"""The whole chain: what a scenario leaves, the same again, and nothing half-written."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from rerun.chunk import RrdReader

from identification.errors import InputError
from testbench.excitation_file import read_trajectory
from testbench.jobs.run import run_scenario
from testbench.log import read_log
from testbench.results import IdentificationResult

from .small_arm import ARM, SCENARIO

FILES = ["estimate.json", "excitation.json", "fit.h5", "report.html", "session.rrd", "validation_1.h5"]
VARIANTS = "variants:\n  loud: {noise: {torque: 0.05}}\n  energy: {identification: {model: energy}}\n"


def scenario_file(folder: Path, extra: str = "") -> Path:
    (folder / "arm.xml").write_text(ARM)
    path = folder / "small.yaml"
    path.write_text(SCENARIO + extra)
    return path


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("scenario")


@pytest.fixture(scope="module")
def result(folder: Path) -> IdentificationResult:
    return run_scenario(scenario_file(folder, VARIANTS), folder / "out", jobs=1)


def entities(path: Path) -> dict[str, int]:
    """Entities of a recording, and how many rows each has."""
    rows: dict[str, int] = {}
    for chunk in RrdReader(path).stream():
        rows[chunk.entity_path] = rows.get(chunk.entity_path, 0) + chunk.num_rows
    return rows


def test_a_scenario_and_its_variants_leave_every_file(folder: Path, result: IdentificationResult) -> None:
    out = folder / "out"
    assert sorted(path.name for path in out.iterdir()) == sorted([*FILES, "energy", "loud"])
    for variant in ("energy", "loud"):
        assert sorted(path.name for path in (out / variant).iterdir()) == FILES
    assert sorted(path.name for path in folder.iterdir()) == ["arm.xml", "out", "small.yaml"]


def test_the_estimate_is_as_good_as_its_noise_allows(folder: Path, result: IdentificationResult) -> None:
    assert result.comparison is not None
    error, bound = np.abs(result.comparison.error), result.comparison.cramer_rao
    # The median of |error| over the bound is .67 for an efficient estimate.
    assert np.median(error / bound) < 2
    assert np.max(error / result.estimate.std) < 4
    found = json.loads((folder / "out" / "estimate.json").read_text())
    assert found["torque_over_noise_floor"] < 1.2
    assert [row["truth"] for row in found["base_parameters"]] == result.comparison.truth.tolist()


def test_the_residual_is_tested_and_the_essential_parameters_reported(
    folder: Path, result: IdentificationResult
) -> None:
    found = json.loads((folder / "out" / "estimate.json").read_text())
    tests = found["residual_tests"]
    assert [len(values) for values in tests.values()] == [2, 2, 2, 2]
    # The torque's noise is white and normal: an alarm at this level is one in a thousand.
    assert min(*tests["whiteness"], *tests["normality"]) > 1e-3
    assert sum(tests["independent_samples"]) == pytest.approx(found["effective_samples"], rel=1e-9)
    essential = [row["essential"] for row in found["base_parameters"]]
    sure = [row["percent_sigma"] < 15 for row in found["base_parameters"]]
    assert all(kept for kept, known in zip(essential, sure, strict=True) if known)
    assert found["dropped_p_value"] >= 0.05
    for variant in ("energy", "loud"):
        other = json.loads((folder / "out" / variant / "estimate.json").read_text())
        assert len(other["residual_tests"]["whiteness"]) == 2
    assert 'id="residual-tests"' in (folder / "out" / "report.html").read_text()


def test_a_louder_sensor_gives_a_wider_estimate_of_the_same_motion(
    folder: Path, result: IdentificationResult
) -> None:
    out = folder / "out"
    assert (out / "loud" / "excitation.json").read_bytes() == (out / "excitation.json").read_bytes()
    quiet, loud = (
        np.array([row["std"] for row in json.loads((place / "estimate.json").read_text())["base_parameters"]])
        for place in (out, out / "loud")
    )
    # Five times the noise, but for what the encoders add to both.
    assert 2 < np.median(loud / quiet) < 6


def test_logs_tell_where_they_come_from(folder: Path, result: IdentificationResult) -> None:
    log = read_log(folder / "out" / "loud" / "fit.h5", with_truth=True)
    assert log.source == "simulation"
    assert log.provenance["scenario"] == "small-loud"
    assert log.provenance["scenario_seed"] == 3
    assert {"mujoco", "numpy", "identification-testbench"} <= set(log.provenance["versions"])
    assert {"position", "torque", "parameters"} <= set(log.truth)
    names, motion = read_trajectory(folder / "out" / "excitation.json")
    assert names == log.joint_names
    assert motion.duration == pytest.approx(log.time[-1])


def test_the_session_loads_back_with_every_run_and_joint(folder: Path, result: IdentificationResult) -> None:
    rows = entities(folder / "out" / "session.rrd")
    for run, recording in (("fit_1", "fit.h5"), ("validation_1", "validation_1.h5")):
        seconds = read_log(folder / "out" / recording).time[-1]
        for joint in ("shoulder", "elbow"):
            series = rows[f"/{run}/joints/{joint}/position/measured"]
            # Thinned to 100 Hz, and one row for its name.
            assert series == pytest.approx(100 * seconds, abs=3)
    assert {"/summary", "/parameters/table"} <= set(rows)


def test_the_report_needs_no_network(folder: Path, result: IdentificationResult) -> None:
    page = (folder / "out" / "report.html").read_text()
    assert "fv_1" in page
    # Plotly's own text holds addresses; what a browser would fetch stands in these tags.
    assert re.findall(r"<(?:script|img|iframe)[^>]*\ssrc=|<link\s|@import", page) == []


def test_the_same_seed_gives_the_same_files_on_two_threads(
    folder: Path, result: IdentificationResult, tmp_path: Path
) -> None:
    run_scenario(scenario_file(tmp_path), tmp_path / "again", jobs=2)
    for name in ("excitation.json", "estimate.json"):
        assert (tmp_path / "again" / name).read_bytes() == (folder / "out" / name).read_bytes()
    for name in ("fit.h5", "validation_1.h5"):
        one, other = read_log(folder / "out" / name), read_log(tmp_path / "again" / name)
        assert np.array_equal(one.position, other.position)
        assert np.array_equal(one.torque, other.torque)


def test_another_seed_gives_other_noise_and_another_motion(
    folder: Path, result: IdentificationResult, tmp_path: Path
) -> None:
    run_scenario(scenario_file(tmp_path), tmp_path / "out", seed=4)
    one, other = read_log(folder / "out" / "fit.h5"), read_log(tmp_path / "out" / "fit.h5")
    assert other.provenance["scenario_seed"] == 4
    assert not np.array_equal(one.reference_position, other.reference_position)


def test_results_go_to_logs_unless_stated_otherwise(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    run_scenario(scenario_file(tmp_path))
    assert sorted(path.name for path in (tmp_path / "logs" / "small").iterdir()) == FILES
    out, err = capsys.readouterr()
    assert out.startswith(f"small: {Path('logs/small')}\n")
    # Progress is for terminals.
    assert err == ""


@pytest.mark.parametrize("last", ["write_log", "write_session"])
def test_an_interrupted_run_leaves_no_half_file(
    last: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(f"testbench.jobs.run.{last}", interrupted)
    with pytest.raises(KeyboardInterrupt):
        run_scenario(scenario_file(tmp_path), tmp_path / "out")
    written = sorted(path.name for path in (tmp_path / "out").iterdir())
    assert set(written) < set(FILES)
    for name in written:
        path = tmp_path / "out" / name
        if name.endswith(".h5"):
            read_log(path)
        elif name.endswith(".json"):
            json.loads(path.read_text())
        else:
            assert path.read_text().rstrip().endswith("</html>")


def test_nothing_is_written_when_a_variant_cannot_run(tmp_path: Path) -> None:
    path = scenario_file(tmp_path, "variants: {odd: {identification: {estimator: best}}}\n")
    with pytest.raises(InputError, match=r"identification\.estimator.*'best'"):
        run_scenario(path, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_eight_joints_with_a_slide_go_through_the_same_chain(models: Path, tmp_path: Path) -> None:
    path = tmp_path / "rail.yaml"
    path.write_text(
        f"name: rail\nmodel: {models / 'rail_arm.xml'}\nseed: 1\n"
        "excitation: {criterion: hadamard, harmonics: 3, starts: 1}\n"
        "simulation: {periods: 1}\nvalidation: {runs: 1, harmonics: 3}\n"
    )
    result = run_scenario(path, tmp_path / "out")
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == FILES
    assert result.robot.units()[0] == "N"
    assert result.comparison is not None
    assert np.median(np.abs(result.comparison.error) / result.comparison.cramer_rao) < 2
    found = json.loads((tmp_path / "out" / "estimate.json").read_text())
    assert found["torque_over_noise_floor"] < 1.2
