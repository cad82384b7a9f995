"""The study of recordings: its plan, and what counts as worse or wrong."""

from dataclasses import replace
from pathlib import Path

import pytest

from identification.errors import InputError
from studies.cases import run_cases
from studies.recordings.judge import Outcome, wrong_names
from studies.recordings.plan import Split, load_plan
from studies.recordings.study import table

PLAN = """
name: two
recordings:
  arm:
    model: arm.xml
    splits: [a + b -> c]
    right: [backlash:j1]
    wrong: [payload, "base_tilt:j2"]
  absent:
    model: other.xml
    splits: [a -> b]
"""
OUTCOME = Outcome("arm", "a + b → c", given=0.3, parameters=0.2, effects=0.1)


@pytest.fixture
def split(tmp_path: Path) -> Split:
    (tmp_path / "plan.yaml").write_text(PLAN)
    folder = tmp_path / "data" / "arm"
    folder.mkdir(parents=True)
    for name in ("arm.xml", "a.h5", "b.h5", "c.h5"):
        (folder / name).touch()
    (split,) = load_plan(tmp_path / "plan.yaml", tmp_path / "data")
    return split


def test_splits_of_the_recordings_that_are_present(split: Split) -> None:
    assert [path.name for path in split.fitted] == ["a.h5", "b.h5"]
    assert split.held_out.name == "c.h5"


@pytest.mark.parametrize("text", ["a + b", "a -> ", "-> c", "a -> ../c"])
def test_a_split_of_another_form_is_refused(tmp_path: Path, text: str) -> None:
    (tmp_path / "arm").mkdir()
    for name in ("arm.xml", "a.h5", "c.h5"):
        (tmp_path / "arm" / name).touch()
    plan = f"name: one\nrecordings:\n  arm:\n    model: arm.xml\n    splits: ['{text}']\n"
    (tmp_path / "plan.yaml").write_text(plan)
    with pytest.raises(InputError, match=r"recordings\.arm"):
        load_plan(tmp_path / "plan.yaml", tmp_path)


def test_a_column_that_is_worse_than_the_one_before_is_worse() -> None:
    assert OUTCOME.worse_by == 0
    assert replace(OUTCOME, effects=0.21).worse_by == pytest.approx(0.01)
    assert replace(OUTCOME, parameters=0.31).worse_by == pytest.approx(0.01)
    assert replace(OUTCOME, parameters=0.3001).worse_by == 0
    assert replace(OUTCOME, effects=float("nan")).worse_by == float("inf")


def test_wrong_names_count_from_one_half(split: Split) -> None:
    named = (
        ("payload", "", 0.6),
        ("base_tilt", "j2", 0.4),
        ("base_tilt", "j1", 0.9),
        ("backlash", "j1", 0.9),
    )
    outcome = replace(OUTCOME, named=named)
    assert wrong_names(split, outcome) == ["payload"]
    assert "WRONG: payload" in table([split], [outcome])


def double(number: int) -> dict[str, int]:
    return {"twice": 2 * number}


def test_finished_cases_are_not_run_again(tmp_path: Path) -> None:
    (tmp_path / "a.json").write_text('{"twice": 0}')
    assert run_cases(double, {"a": 1, "b": 2}, tmp_path, jobs=1) == [{"twice": 0}, {"twice": 4}]
