"""Scores of the study of plants: intervals, calibration, judging, and that it resumes."""

from pathlib import Path

import numpy as np
import pytest

from identification.errors import InputError
from studies.plants_study import study as plants_study
from studies.plants_study.scoring import Share, calibration_error, reliability, risk_and_coverage
from studies.plants_study.study import Robot, judged, page, scored, study, work


def test_wilson_interval() -> None:
    # Wilson's formula by hand for 8 of 10: centre (p + z²/2n) / (1 + z²/n).
    z, n, p = 1.959964, 10, 0.8
    centre = (p + z**2 / (2 * n)) / (1 + z**2 / n)
    half = z / (1 + z**2 / n) * np.sqrt(p * (1 - p) / n + z**2 / (4 * n**2))
    np.testing.assert_allclose(Share(8, 10).interval, (centre - half, centre + half), rtol=1e-6)
    assert Share(0, 0).value is None
    assert Share(0, 0).interval == (0.0, 1.0)


def test_calibration_error_of_names_that_are_right_as_often_as_stated_is_small() -> None:
    rng = np.random.default_rng(0)
    stated = rng.uniform(0.05, 1, 20_000)
    honest = rng.random(20_000) < stated
    assert calibration_error(stated, honest) == pytest.approx(0, abs=0.015)
    assert calibration_error(stated, np.zeros(20_000)) == pytest.approx(stated.mean(), abs=1e-9)
    assert calibration_error([], []) is None
    assert sum(each.right.total for each in reliability(stated, honest)) == 20_000


def test_risk_falls_with_coverage_where_probabilities_order_the_names() -> None:
    curve = risk_and_coverage([0.9, 0.6, None, 0.6], [True, False, False, True])
    assert curve == [(0.25, 0.0), (0.75, pytest.approx(1 / 3))]


def said(*names: dict[str, object], verdict: str = "effect") -> dict[str, object]:
    filled = [{"parameters": {}, "probability": 0.9, "confusable_with": [], **name} for name in names]
    return {"verdict": verdict, "effects": filled}


FAULT = {"effect": "backlash", "joint": "joint_2", "into": None, "law": "", "share": 0.2}
CASE = {"plant": "cobot", "seed": 1, "kind": "single"}
RIGHT = {"effect": "backlash", "joint": "joint_2"}


def test_a_name_is_right_at_its_joint_alone() -> None:
    assert judged(CASE, [FAULT], said(RIGHT))["first_right"]
    elsewhere = judged(CASE, [FAULT], said(RIGHT | {"joint": "joint_3"}))
    assert not elsewhere["first_right"]
    assert elsewhere["wrong"] == 1
    alike = judged(
        CASE,
        [FAULT],
        said({"effect": "joint_elasticity", "joint": "joint_2", "confusable_with": ["backlash"]}),
    )
    assert (alike["first_right"], alike["in_set"], alike["wrong"]) == (False, True, 0)
    assert not judged(CASE, [FAULT], said(verdict="none"))["in_set"]


def test_joints_of_a_coupling_have_no_order() -> None:
    fault = {"effect": "joint_coupling", "joint": "joint_5", "into": "joint_6", "law": "", "share": 0.2}
    name = {"effect": "joint_coupling", "joint": "joint_6", "parameters": {"into": "joint_5"}}
    assert judged(CASE, [fault], said(name))["all_named"]


def test_a_name_for_an_unknown_law_is_wrong() -> None:
    fault = FAULT | {"effect": "unknown", "law": "drag"}
    row = judged(CASE | {"kind": "unknown"}, [fault], said(RIGHT))
    assert (row["wrong"], row["first_right"], row["all_named"]) == (1, False, False)
    scores = scored([row | {"seconds": 1.0}])["all"]["shares"]
    assert scores["unknown laws without a name"]["count"] == 0
    assert scores["robots with a wrong name"]["count"] == 1


def test_a_robot_is_drawn_and_diagnosed() -> None:
    row = work(Robot("servo_arm", 3))
    assert row["plant"] == "servo_arm"
    assert row["verdict"] in ("none", "parameters", "effect", "unknown")
    assert row["kind"] == "healthy" or row["faults"]


def test_the_study_resumes_from_what_it_has_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(plants_study, "plants", lambda: ("servo_arm",))
    rows = [judged(CASE | {"seed": seed}, [FAULT], said(RIGHT)) | {"seconds": 2.0} for seed in (1, 2)]
    for index, row in enumerate(rows, 1):
        plants_study.write_json(row, tmp_path / "results" / f"servo_arm_{index:04d}.json")
    scores = study(tmp_path, robots=2)
    assert scores["all"]["shares"]["singles, first name right"]["count"] == 2
    assert (tmp_path / "plants.md").read_text() == page(scores)
    assert len((tmp_path / "plants.csv").read_text().splitlines()) == 3
    with pytest.raises(InputError, match="the robots and seed"):
        study(tmp_path, robots=3)
