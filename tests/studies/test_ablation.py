"""The study of rules: what tracing notes, which rules there are, how they are neutralised, the table."""

import importlib.util
import math
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

import diagnosis.plausibility
from studies.ablation import rules, traced
from studies.ablation.table import is_right, mcnemar, page, tabulated, verdicts, worth
from studies.ablation.traced import TRACE, Traced, followed
from studies.ablation.work import answer_of

LEVEL = "level = inf"


@pytest.fixture(autouse=True)
def record() -> Iterator[set[str]]:
    """The rules noted in a test, from none on."""
    TRACE.matter.clear()
    yield TRACE.matter
    TRACE.matter.clear()


def level(value: float = 2.0) -> Any:
    return Traced(value, {LEVEL: math.inf})


def test_a_comparison_that_turns_without_the_rule_is_noted(record: set[str]) -> None:
    assert not level() < 1.0
    assert not record
    assert level() < 3.0
    assert record == {LEVEL}


@pytest.mark.parametrize("number", [3.0, np.float64(3.0), np.array([1.0, 3.0]), 3])
def test_what_is_computed_from_a_number_is_compared_for_it(number: Any, record: set[str]) -> None:
    derived = np.sqrt(4 * level() ** 2) / 2 - 1
    assert np.any(number > derived)
    assert record == {LEVEL}


def test_what_cannot_be_followed_is_noted(record: set[str]) -> None:
    assert math.sqrt(level(4.0)) == 2
    assert record == {LEVEL}


def test_a_turn_that_does_not_change_the_result_does_not_matter(record: set[str]) -> None:
    calls = []

    @followed("f", {}, is_opaque=False)
    def f(x: float) -> bool:
        calls.append(x)
        return x > level() or x > 1

    assert f(3.0)
    assert not record
    assert calls == [3.0, 3.0]

    @followed("g", {"g = False": False}, is_opaque=False)
    def g(x: float) -> bool:
        return x > level()

    assert g(3.0)
    assert record == {LEVEL, "g = False"}


def test_a_number_that_depends_on_a_rule_keeps_both_values(record: set[str]) -> None:
    @followed("f", {}, is_opaque=False)
    def f(x: float) -> float:
        return 1.0 if x > level() else 0.5

    assert f(3.0) > 0.1
    assert not record
    assert f(3.0) > 0.7
    assert record == {LEVEL}


def test_what_an_opaque_function_turns_matters_at_once(record: set[str]) -> None:
    @followed("keep", {}, is_opaque=True)
    def keep(x: float) -> None:
        assert x > level()

    @followed("f", {}, is_opaque=False)
    def f(x: float) -> int:
        keep(x)
        return 1

    assert f(3.0) == 1
    assert record == {LEVEL}


def test_rules_are_numbers_and_functions_but_no_grids() -> None:
    source = """
LEAST, MOST = 0.5, -2.0
LEVELS = {"a": (1.0, 3)}
GRID = (1.0, 2.0, 3.0, 4.0)
def is_large(x) -> bool: ...
def found(x) -> float | None: ...
def keeps(x) -> None: ...
"""
    visitor = rules._Marked("diagnosis.room.file")
    visitor.visit(rules.ast.parse(source))
    assert [rule.key for rule in visitor.found] == [
        "room.file.LEAST = 0",
        "room.file.LEAST = inf",
        "room.file.MOST = 0",
        "room.file.MOST = inf",
        "room.file.LEVELS[0] = 0",
        "room.file.LEVELS[0] = inf",
        "room.file.LEVELS[1] = 0",
        "room.file.LEVELS[1] = inf",
        "room.file.is_large = False",
        "room.file.is_large = True",
        "room.file.found = None",
    ]


def without(off: str | None) -> ModuleType:
    """The module of material effects with a rule neutralised, beside the one that is imported."""
    name = "diagnosis.plausibility.materiality"
    spec = rules._Finder(off).find_spec(name, list(diagnosis.plausibility.__path__))
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_a_number_and_a_function_are_neutralised() -> None:
    module = without("plausibility.materiality.SMALLEST_WALD = inf")
    assert math.isinf(module.SMALLEST_WALD)
    module = without("plausibility.materiality.is_material = True")
    assert (module.is_material(), module.SMALLEST_WALD) == (True, 25.0)
    assert without("plausibility.materiality.OF_ENCODERS = 0").OF_ENCODERS == 0
    assert isinstance(without(None).SMALLEST_WALD, Traced)


def test_a_rule_is_neutralised_before_the_diagnosis_is_imported() -> None:
    with pytest.raises(RuntimeError, match="imported already"):
        rules.install("plausibility.materiality.SMALLEST_WALD = inf")


def row(kind: str, right: int = 0, wrong: int = 0, every: bool = False, **more: Any) -> dict[str, Any]:
    named = [{"effect": f"e{k}", "joint": None, "into": None} for k in range(right + wrong)]
    answer = {"verdict": "effect" if named else "none", "all_named": every, "seconds": 1.0}
    return {"kind": kind, "named": named, "wrong": wrong, "right": [True] * right, **answer, **more}


def test_answers_are_right_with_every_fault_and_nothing_else() -> None:
    assert is_right(row("pair", right=2, every=True))
    assert not is_right(row("pair", right=1))
    assert not is_right(row("single", right=1, wrong=1, every=True))
    assert is_right(row("healthy"))
    assert not is_right(row("unknown", wrong=1))
    assert (worth(row("healthy")), worth(row("single")), worth(row("single", 1, 1))) == (1, 0, -1)


def test_table_counts_what_turns() -> None:
    known = sorted(key for key, rule in rules.rules().items() if rule.off == "inf")
    key, other, silent = known[:3]
    traces = {
        "a": row("single", right=1, every=True, matter=[key, other]),
        "b": row("healthy", wrong=1, matter=[key]),
    }
    runs = {key: {"a": row("single", wrong=1), "b": row("healthy")}, other: {"a": traces["a"]}}
    table = tabulated(traces, runs)
    (line,) = [each for each in table["rules"] if f"{each['place']} = {each['off']}" == key]
    assert (line["right_to_wrong"], line["wrong_to_right"], line["worth"]) == (1, 1, -3 + 3)
    found = verdicts(table)
    places = [rules.rules()[each].place for each in (other, silent)]
    assert [found[place] for place in places] == ["nothing", "nothing"]
    assert f"`{line['place']}`" in page(table)
    assert answer_of(traces["a"]) == answer_of(traces["b"]) != answer_of(row("healthy"))


def test_mcnemar() -> None:
    assert mcnemar(0, 0) == 1
    assert mcnemar(0, 5) == pytest.approx(2 * 0.5**5)


def test_results_are_equal_by_content() -> None:
    assert traced.same((1.0, np.array([np.nan, 2.0])), (1.0, np.array([np.nan, 2.0])))
    assert not traced.same([1.0], [2.0])
    assert not traced.same(object(), object())
    assert traced.same(Path("a"), Path("a")) is False
