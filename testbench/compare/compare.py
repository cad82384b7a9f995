"""The job behind ``testbench compare``: a grid of cases, their rows as CSV, and the page."""

import csv
import importlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from identification.errors import InputError
from identification.excitation.design import DesignOptions, design_excitation, random_excitation
from identification.excitation.trajectory import Trajectory

from ..files import replacing, require_writable
from ..jobs.excite import design_room
from ..robot import load_robot
from ..scenario import Scenario, load_scenario
from . import criteria, estimators
from .case import Case, Row, require_question
from .experiment import described
from .page import write_page
from .runner import run_cases
from .verdict import verdict

SCENARIOS = Path("scenarios")
PAGE = "report.html"
WRITTEN = ("cases", "results.csv", "summary.csv", PAGE)


def compare(
    question: str,
    scenario_file: Path | None,
    out: Path,
    jobs: int | None = None,
    scheduler: str | None = None,
    seed: int | None = None,
) -> list[str]:
    """Run what is left of a comparison, write OUT/results.csv, summary.csv and report.html; the verdict.

    scenario_file: scenarios/compare_QUESTION.yaml when None. jobs, scheduler: see ``run_cases``. seed:
    instead of the scenario's. Raises InputError.
    """
    require_question(question)
    require_writable(out / PAGE)
    path = scenario_file or SCENARIOS / f"compare_{question}.yaml"
    scenario, variants = load_scenario(path)
    if seed is not None:
        scenario, variants = _reseeded(scenario, seed), {k: _reseeded(v, seed) for k, v in variants.items()}
    levels = {scenario.comparison.level: scenario} | variants
    module = importlib.import_module(f"{__package__}.{question}")
    chosen = _chosen(path, scenario, module)
    cases = _cases(question, chosen, levels)
    if question == "estimators":
        cases += estimators.recorded_cases(scenario, chosen)
    rows = run_cases(cases, out / "cases", jobs, scheduler)
    _write_csv(rows, out / "results.csv")
    _write_csv(summary(rows), out / "summary.csv")
    found = verdict(question, rows)
    write_page(question, scenario, tuple(levels), rows, found, out / PAGE)
    for line in found:
        print(line)
    return found


def _reseeded(scenario: Scenario, seed: int) -> Scenario:
    return scenario.model_copy(update={"seed": seed})


def _chosen(path: Path, scenario: Scenario, module: Any) -> tuple[str, ...]:
    """What is compared. Raises InputError for a name that does not exist."""
    known = module.choices()
    for name in scenario.comparison.choices:
        if name not in known:
            raise InputError(path, "comparison.choices", "a known name", repr(name), known)
    return scenario.comparison.choices or known


def _cases(question: str, chosen: Sequence[str], levels: dict[str, Scenario]) -> list[Case]:
    """The grid: level by choice by seed."""
    first = next(iter(levels.values()))
    motions = _motions(first, fitted=question in ("estimators", "differentiation"))
    described_motions = {name: motion.to_dict() for name, motion in motions.items()}
    files = {"model": str(first.model)}
    cases = []
    for level, scenario in levels.items():
        settings = {"scenario": described(scenario), **described_motions}
        for choice in chosen:
            seeds = range(scenario.comparison.repetitions)
            if question == "criteria":
                seeds = criteria.seeds_of(scenario, choice)
            cases += [Case(question, choice, level, seed, settings, files) for seed in seeds]
    if question == "criteria":
        level, scenario = next(iter(levels.items()))
        settings = {"scenario": described(scenario)}
        # First, before the cores are busy with designs.
        cases.insert(0, Case(question, criteria.ALONE, level, 0, settings, files))
    return cases


def _motions(scenario: Scenario, fitted: bool) -> dict[str, Trajectory]:
    """The motion to validate on, and the one that all cases fit where they share it."""
    robot = load_robot(scenario.model, scenario.choice)
    section = scenario.excitation
    shared: dict[str, Any] = {
        "groups": scenario.identification.parameters,
        "limit_share": section.limit_share,
        "seed": scenario.seed,
    }
    random = DesignOptions(
        harmonics=scenario.validation.harmonics, base_frequency=scenario.validation.base_frequency, **shared
    )
    room = design_room(robot, section.limit_share, section.velocity_limit, section.clearance)
    chain, parameters, limits, clearance = robot.chain, robot.parameters, room.limits, room.clearance
    motions = {"validation": random_excitation(chain, parameters, limits, random, clearance).trajectory}
    if fitted:
        options = DesignOptions(
            trajectory=section.trajectory,
            harmonics=section.harmonics,
            base_frequency=section.base_frequency,
            starts=section.starts,
            **shared,
        )
        found = design_excitation(chain, parameters, limits, section.criterion, options, clearance)
        motions["fit"] = found.trajectory
    return motions


def summary(rows: Sequence[Row]) -> list[Row]:
    """Medians over the seeds of each choice at each level; ``cases`` counts them."""
    groups: dict[tuple[str, str], list[Row]] = {}
    for row in rows:
        groups.setdefault((str(row["choice"]), str(row["level"])), []).append(row)
    out = []
    for (choice, level), members in groups.items():
        line: Row = {"choice": choice, "level": level, "cases": len(members), "note": members[0]["note"]}
        names = dict.fromkeys(name for row in members for name in row)
        for name in names:
            numbers = [row[name] for row in members if isinstance(row.get(name), float | int)]
            if name != "seed" and numbers:
                line[name] = float(np.median(np.array(numbers, dtype=float)))
        out.append(line)
    return out


def _write_csv(rows: Sequence[Row], path: Path) -> None:
    """One line a row, whole or not at all; what is unknown is empty."""
    names = dict.fromkeys(name for row in rows for name in row)
    with replacing(path) as temporary, temporary.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, names, restval="")
        writer.writeheader()
        writer.writerows(rows)
