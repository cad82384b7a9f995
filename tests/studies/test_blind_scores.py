"""Scores of blind cases are what arithmetic says: one case judged, and the figures over all."""

import numpy as np
import pytest

from identification.errors import InputError
from studies.blind.case import BESIDE, LITTLE
from studies.blind.judge import closed, judge
from studies.blind.merit import (
    Rejections,
    Share,
    detection_limit,
    rejections,
    reliability,
    risk_and_coverage,
    shares,
)

from .blind_documents import answer, diagnosis

RIGHT = ("stribeck_friction", "elbow", 0.9, (), 2.2)


def test_what_counts_as_right() -> None:
    exact = judge(answer(), diagnosis(RIGHT))
    assert (exact["exact"], exact["right"], exact["wrong"], exact["joint_right"]) == (True, True, False, True)
    assert exact["parameter_error"] == pytest.approx(0.1)
    elsewhere = judge(answer(), diagnosis(("stribeck_friction", "shoulder", 0.9, (), 2.0)))
    assert (elsewhere["right"], elsewhere["effect_right"], elsewhere["wrong"]) == (False, True, True)
    # The catalogue knows these two as alike; that must also be said.
    other = ("presliding_hysteresis", "elbow", 0.6, ("stribeck_friction",), 2.0)
    stated = judge(answer(), diagnosis(other))
    assert (stated["exact"], stated["right"], stated["wrong"]) == (False, True, False)
    unsaid = judge(answer(), diagnosis((*other[:3], (), 2.0)))
    assert (unsaid["right"], unsaid["wrong"]) == (False, True)
    # Stated, but no more alike than any two effects: not wrong, and not right.
    far = judge(answer(), diagnosis(("torque_saturation", "elbow", 0.6, ("stribeck_friction",), 2.0)))
    assert (far["right"], far["wrong"]) == (False, False)
    silent = judge(answer(), diagnosis())
    assert (silent["right"], silent["wrong"], silent["joint_right"]) == (False, False, True)


def test_both_of_a_pair_must_be_named_whatever_their_order() -> None:
    second = answer(effect="joint_coupling", joint="shoulder")["effects"][0] | {"into": "elbow"}
    both = answer("pair")
    both["effects"] = [*both["effects"], second]
    coupling = {
        "effect": "joint_coupling",
        "joint": "elbow",
        "probability": 0.8,
        "parameters": {"into": "shoulder"},
    }
    said = diagnosis(RIGHT)
    assert not judge(both, said)["all_found"]
    said["effects"] = [coupling, *said["effects"]]
    assert judge(both, said)["all_found"]
    assert judge(both, said)["extra"] == 0


def test_a_document_that_is_no_diagnosis_is_refused() -> None:
    with pytest.raises(InputError, match="a.json: verdict: expected a verdict, got 'maybe'"):
        judge(answer(), diagnosis(verdict="maybe"), "a.json")
    with pytest.raises(InputError, match="a.json: effects: expected effects of the catalogue"):
        judge(answer(), diagnosis(("gremlins", "elbow", 1.0, (), 1.0)), "a.json")


def test_shares_carry_wilsons_interval() -> None:
    low, high = Share(8, 10).interval or (0.0, 0.0)
    assert (low, high) == pytest.approx((0.4902, 0.9433), abs=1e-4)
    assert Share(0, 0).value is None


def test_the_figures_are_counted_by_kind() -> None:
    rows = [
        judge(answer(), diagnosis(RIGHT)),
        judge(answer(severity=0.1), diagnosis()),
        judge(answer("none"), diagnosis(RIGHT)),
        judge(answer("none"), diagnosis(verdict="parameters")),
        judge(answer("unknown", effect="detent_friction"), diagnosis(verdict="unknown")),
        judge(answer("unknown", effect="detent_friction"), diagnosis(RIGHT, where="shoulder")),
    ]
    rows = [row | closed(answer(), {"parameters": [4.0, 2.0], "effects": [1.5, 1.5]}) for row in rows]
    found = shares(rows)
    assert found["singles, first effect and joint right, severity .35 and up"] == Share(1, 1)
    assert found["singles, first effect and joint right"] == Share(1, 2)
    assert found["healthy, false alarm"] == Share(1, 2)
    assert found["unknown, reported as unknown"] == Share(1, 2)
    assert found["unknown, joint right"] == Share(1, 2)
    assert rows[0]["closed"] == pytest.approx(0.75)
    assert found["at least 80 % of the gap closed"] == Share(0, 2)
    calibration = reliability(rows)
    # Three names at .9, of which one acts.
    assert calibration.stated == pytest.approx((0.9,))
    assert calibration.correct == (Share(1, 3),)
    assert calibration.error == pytest.approx(0.9 - 1 / 3)
    coverage, risk = risk_and_coverage(rows)
    assert coverage == pytest.approx([1 / 6, 2 / 6, 3 / 6])
    assert risk[-1] == pytest.approx(2 / 3)


def test_what_was_drawn_again_is_counted_by_effect() -> None:
    little = {"effect": "backlash", "severity": 0.1, "attempt": 0, "why": LITTLE}
    beside = {"effect": "stribeck_friction", "severity": 0.5, "attempt": 0, "why": BESIDE}
    rows = [judge(answer(attempt=1, rejected=[little, beside]), diagnosis()), judge(answer(), diagnosis())]
    found = rejections(rows)
    assert found == {"backlash": Rejections(1, 1, 0, 0), "stribeck_friction": Rejections(3, 0, 1, 0)}
    assert rows[0]["redrawn"] == 1


def test_an_answer_that_does_not_tell_what_was_rejected_is_refused() -> None:
    old = {key: value for key, value in answer().items() if key != "rejected"}
    with pytest.raises(InputError, match="a.json: rejected: expected an answer that lists"):
        judge(old, diagnosis(), "a.json")


def test_the_detection_limit_is_where_the_share_found_passes_the_level() -> None:
    size = np.array([0.4, 0.1, 0.2, 0.3, 0.5])
    found = np.array([True, False, True, False, True])
    # Sorted: no, yes, no, yes, yes; the middle two are pooled to a half.
    assert detection_limit(size, found, 0.5) == 0.2
    assert detection_limit(size, found, 0.9) == 0.4
    assert detection_limit(size, np.zeros(5, dtype=bool), 0.5) is None
