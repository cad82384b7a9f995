"""The study of rules: kept cases traced, each rule that matters neutralised, and what that turns."""

import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from testbench.files import read_json, require_writable, write_json, write_text

from ..plants import plants
from .rules import rules
from .table import page, tabulated
from .work import ANSWER, apart, draw_case, file_of, neutralised, trace

CASES, TRACES, RUNS, PAGE, TABLE = "cases", "traces", "runs", "ablation.md", "ablation.json"
WRITTEN = (CASES, TRACES, RUNS, PAGE, TABLE)


def study(out: Path, robots: int = 5, seed: int = 0, minutes: float = 60.0) -> dict[str, Any]:
    """Draw the cases, trace each, rerun those that a rule may change without it; a second call resumes.

    robots: a plant. minutes: of reruns; those that can be settled soonest come first. Leaves ablation.md and
    ablation.json. Returns the table.
    """
    require_writable(out / TABLE)
    # Libraries that every process needs, without the diagnosis.
    import mujoco
    import plotly.graph_objects
    import rerun
    import scipy.optimize

    assert all((mujoco, plotly, rerun, scipy))
    names = [f"{plant}_{index:04d}" for index in range(1, robots + 1) for plant in plants()]
    for name in names:
        if not (out / CASES / name / ANSWER).is_file():
            plant, _, index = name.rpartition("_")
            draw_case(plant, 10_000 * seed + int(index), out / CASES / name)
    for name in names:
        if not (place := out / TRACES / f"{name}.json").is_file():
            apart(trace, place, out / CASES / name)
            print(name, flush=True)
    traces = {name: read_json(out / TRACES / f"{name}.json") for name in names}
    end = time.monotonic() + 60 * minutes
    for rule, name in in_turn(traces):
        place = out / RUNS / file_of(rule) / f"{name}.json"
        if time.monotonic() > end:
            break
        if not place.is_file():
            apart(neutralised, place, out / CASES / name, rule)
            print(rule, name, flush=True)
    return leave(out, traces)


def leave(out: Path, traces: Mapping[str, Any]) -> dict[str, Any]:
    """Write the table of what has been run so far, and return it."""
    runs = {
        rule: {path.stem: read_json(path) for path in sorted((out / RUNS / file_of(rule)).glob("*.json"))}
        for rule in rules()
    }
    table = tabulated(traces, runs)
    write_json(table, out / TABLE)
    write_text(page(table), out / PAGE)
    print(f"{out / PAGE}: {len(table['rules'])} rules on {len(traces)} cases")
    return table


def mattering(traces: Mapping[str, Any]) -> dict[str, list[str]]:
    """The cases to which each way of neutralising a rule may matter, by its key."""
    return {rule: [name for name, row in traces.items() if rule in row["matter"]] for rule in rules()}


def in_turn(traces: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """Rules and cases to rerun, those first that are settled soonest.

    A place that can be neutralised one way without any case noticing is settled as it is.
    """
    known = rules()
    cases = mattering(traces)
    settled = {known[rule].place for rule, names in cases.items() if not names}
    cost = {rule: sum(traces[name]["seconds"] for name in names) for rule, names in cases.items()}
    for rule in sorted(cost, key=lambda each: (cost[each], each)):
        if known[rule].place not in settled:
            yield from ((rule, name) for name in _cheapest(cases[rule], traces))


def _cheapest(names: Sequence[str], traces: Mapping[str, Any]) -> list[str]:
    return sorted(names, key=lambda name: (traces[name]["seconds"], name))
