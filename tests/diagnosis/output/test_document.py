"""How a diagnosis is written and read back, and what a job refuses."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from diagnosis.correction.corrected_model import corrected_model
from diagnosis.correction.correction_document import Term, correction_document, read_correction
from diagnosis.correction.prediction import logged_motion, predict, term_torque
from diagnosis.data.preparation import prepare
from diagnosis.decision.findings import Diagnosis
from diagnosis.job import diagnose_logs
from diagnosis.report.document import write_diagnosis
from diagnosis.residual.spectrum import above_band
from identification.errors import InputError
from testbench.log import CHANNELS, Recording, read_log, write_log
from testbench.robot import Robot

from ...diagnosed import diagnosed, exact_gap
from .arm import ARM, LIFT


def test_document_follows_the_contract(folder: Path, answer: Diagnosis) -> None:
    document = json.loads((folder / "diagnosis.json").read_text())
    assert (document["format"], document["format_version"]) == ("gap-diagnosis", 1)
    assert document["verdict"] == "effect"
    (effect,) = document["effects"]
    assert (effect["effect"], effect["joint"]) == ("stribeck_friction", "lift")
    assert effect["confusable_with"] == ["presliding_hysteresis"]
    assert set(effect["parameters"]) == {"extra", "velocity", "exponent"}
    assert effect["parameters"]["extra"]["unit"] == "N·m"
    probabilities = [each["probability"] for each in document["candidates"]]
    assert probabilities == sorted(probabilities, reverse=True)
    gap = document["gap"]
    assert gap["joint_names"] == ["turn", "lift", "reach"]
    assert all(0 < each <= 20 for each in gap["band"])
    assert gap["over_all_frequencies"]["effects"] == answer.gap.over_all(answer.gap.effects).tolist()
    assert gap["unit"] == "N·m (N for a slide joint)"
    summed = {stage: sum(gap[stage]) for stage in ("parameters", "effects", "noise_floor")}
    closed = (summed["parameters"] - summed["effects"]) / (summed["parameters"] - summed["noise_floor"])
    assert gap["closed"] == pytest.approx(closed, rel=1e-12)
    first = document["where"][0]
    assert {"joint", "share", "regime", "gap_rms", "noise_rms", "unit", "regimes"} == set(first)
    assert first["joint"] == "lift"
    for part in first["regimes"]:
        low, high = part["interval"]
        assert 0 <= low <= high <= 1
    assert document["not_in_mjcf"] == ["something"]
    assert document["corrected_file"]["torque"] == {
        "nominal": [4.0] * 3,
        "laws": [1.0] * 3,
        "file": [2.0] * 3,
    }
    assert document["next_experiment"] is None


def test_over_all_frequencies_is_found_what_the_torque_has_above_the_band(
    robot: Robot, runs: dict[str, Recording]
) -> None:
    run = runs["run_1"]
    hum = 2.0 * np.sin(2 * np.pi * 100.0 * run.time)[:, None]
    before, after = (
        above_band(prepare(robot, {"run_1": each})) for each in (run, replace(run, torque=run.torque + hum))
    )
    np.testing.assert_allclose(after, np.hypot(before, 2.0 / np.sqrt(2)), rtol=0.02)
    gap = replace(exact_gap(*np.array([[9.0], [4.0], [3.0], [1.0]])), above=np.array([4.0]))
    assert gap.over_all(gap.effects) == 5.0


def test_coupling_names_its_second_joint(robot: Robot, runs: dict[str, Recording], tmp_path: Path) -> None:
    coupled = diagnosed(robot, {"run_1": runs["run_1"]}, [("joint_coupling", 0, 1)])
    write_diagnosis(coupled, tmp_path / "diagnosis.json")
    (effect,) = json.loads((tmp_path / "diagnosis.json").read_text())["effects"]
    assert (effect["joint"], effect["parameters"]["into"]) == ("turn", "lift")


def test_corrected_model_survives_its_file(answer: Diagnosis) -> None:
    model = corrected_model(answer)
    text = json.dumps(correction_document(model), allow_nan=False)
    again = read_correction(json.loads(text), "file")
    assert json.dumps(correction_document(again)) == text
    np.testing.assert_array_equal(again.limits.upper, model.limits.upper)


def test_shapes_of_another_version_are_one_clear_line(answer: Diagnosis, runs: dict[str, Recording]) -> None:
    logged = logged_motion(corrected_model(answer), runs["run_3"])
    old = Term("thermal_friction_drift", LIFT, None, {"time_constant": 20.0, "carried": 0.0}, np.ones(2))
    with pytest.raises(
        InputError, match="expected the shapes carried, even, paused, power, time_constant, got carried, time"
    ):
        term_torque(old, logged)


def test_folder_without_a_diagnosis_is_one_clear_line(folder: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="diagnosis.json: expected a folder that diagnose has written"):
        predict(tmp_path, folder / "unseen.h5", tmp_path / "out.h5")
    (tmp_path / "diagnosis.json").write_text('{"format": "gap-diagnosis"}')
    with pytest.raises(InputError, match="correction"):
        predict(tmp_path, folder / "unseen.h5", tmp_path / "out.h5")


def test_a_log_that_is_too_short_is_named_by_its_path(robot: Robot, folder: Path, tmp_path: Path) -> None:
    run, end = read_log(folder / "unseen.h5"), slice(150)
    names = ("time", *(channel for _, channel, _, _ in CHANNELS))
    short = {name: None if getattr(run, name) is None else getattr(run, name)[end] for name in names}
    write_log(replace(run, **short), tmp_path / "short.h5")
    with pytest.raises(InputError, match=rf"{tmp_path}/short\.h5: time: expected at least 0\.2 s"):
        diagnose_logs(robot.path, [tmp_path / "short.h5"], tmp_path / "d")
    with pytest.raises(InputError, match=rf"{tmp_path}/short\.h5: time: expected at least 0\.2 s"):
        predict(folder, tmp_path / "short.h5", tmp_path / "p.h5")


def test_job_refuses_an_unknown_effect_and_another_robots_log(
    robot: Robot, folder: Path, tmp_path: Path
) -> None:
    with pytest.raises(InputError, match="without: expected the name of an effect"):
        diagnose_logs(robot.path, [folder / "unseen.h5"], tmp_path, without=["friction"])
    other = tmp_path / "other.xml"
    other.write_text(ARM.replace('"lift"', '"raise"'))
    with pytest.raises(InputError, match=r"unseen.h5: joint_names"):
        diagnose_logs(other, [folder / "unseen.h5"], tmp_path)
