"""report.html of a comparison: the verdict, the plots that show it, and every median."""

import importlib
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ..files import write_text
from ..findings import significant
from ..report.page import Plot, plot, rendered, time_stamp
from ..scenario import Scenario
from . import figures
from .case import Row
from .criteria import ALONE
from .estimators import RECORDED

TITLES = {
    "criteria": "Which excitation criterion?",
    "estimators": "Which estimator?",
    "differentiation": "Which differentiation?",
    "trajectories": "Which kind of trajectory?",
}
# Metric: what the axis says.
LABELS = {
    "over_bound": "median parameter error / Cramér-Rao bound",
    "prediction_error": "torque error on a motion not fitted / RMS torque",
    "parameter_error": "median relative parameter error",
    "inside": "share of parameters within two stated deviations",
    "seconds": "processor time, s",
    "velocity_error": "velocity error / RMS velocity",
    "acceleration_error": "acceleration error / RMS acceleration",
    "relative_bound": "median Cramér-Rao deviation / value",
    "condition_number": "condition number",
    "minus_logdet": "-log det of the information",
    "validation_residual": "residual on the other half / RMS torque",
    "fit_residual": "residual on the half fitted / RMS torque",
}


def write_page(
    question: str,
    scenario: Scenario,
    levels: Sequence[str],
    rows: Sequence[Row],
    verdict: Sequence[str],
    path: Path,
) -> None:
    """Write the page, whole or not at all."""
    metrics = importlib.import_module(f"{__package__}.{question}").METRICS
    simulated = [row for row in rows if row["choice"] != ALONE and row["level"] != RECORDED]
    choices = tuple(dict.fromkeys(str(row["choice"]) for row in simulated))
    recorded = [row for row in rows if row["level"] == RECORDED]
    text = rendered(
        "compare.html",
        ("testbench.report",),
        time_stamp(),
        title=TITLES[question],
        model=scenario.model.name,
        cases=len(rows),
        verdict=verdict,
        plots=_plots(question, simulated, choices, levels, metrics)
        + _alone(rows)
        + _recorded(recorded, choices),
        tables=[(level, _table(simulated, choices, level, metrics)) for level in levels]
        + ([("recorded", _table(recorded, choices, RECORDED, RECORDED_METRICS))] if recorded else []),
    )
    write_text(text, path)


RECORDED_METRICS = ("validation_residual", "fit_residual", "seconds")


def _plots(
    question: str, rows: Sequence[Row], choices: Sequence[str], levels: Sequence[str], metrics: Sequence[str]
) -> list[Plot]:
    first = metrics[0]
    plots = []
    if len(levels) > 1:
        for metric in ("prediction_error", first):
            figure = figures.against_level(rows, choices, levels, metric, LABELS[metric])
            plots.append(plot(f"level-{metric}", f"Noise: {LABELS[metric]}", figure))
    accuracy = "relative_bound" if question == "criteria" else "prediction_error"
    figure = figures.time_against(rows, choices, levels, accuracy, LABELS[accuracy])
    caption = "Time against accuracy: lower left is best"
    if len(levels) > 1:
        caption += f"; {', '.join(f'{figures.SYMBOLS[i]} {level}' for i, level in enumerate(levels))}"
    plots.append(plot("time", caption, figure))
    last = levels[-1]
    own = [row for row in rows if row["level"] == last]
    for metric in metrics:
        # What may be negative, or lies between 0 and 1, has no logarithmic box.
        if metric not in ("inside", "seconds", "minus_logdet"):
            figure = figures.boxes(own, choices, metric, LABELS[metric])
            plots.append(plot(f"box-{metric}", f"Every seed at {last}: {LABELS[metric]}", figure))
    return plots


def _alone(rows: Sequence[Row]) -> list[Plot]:
    """The criteria's cost alone, where it was measured."""
    cost: dict[str, float] = {}
    for row in rows:
        if row["choice"] == ALONE:
            cost = {name: float(value) for name, value in row.items() if name.endswith("_ms") and value}
    if not cost:
        return []
    names = sorted(cost, key=lambda name: cost[name])
    labels = [name.removesuffix("_ms").replace("_", " ") for name in names]
    figure = figures.bars(labels, [cost[name] for name in names], "ms an evaluation")
    return [plot("alone", "The criterion alone, once the regressor is there", figure)]


def _recorded(rows: Sequence[Row], choices: Sequence[str]) -> list[Plot]:
    if not any("validation_residual" in row for row in rows):
        return []
    figure = figures.boxes(rows, choices, "validation_residual", LABELS["validation_residual"])
    return [plot("recorded", "On the recorded robot, each half predicted from the other", figure)]


def _table(
    rows: Sequence[Row], choices: Sequence[str], level: str, metrics: Sequence[str]
) -> tuple[list[str], list[list[str]]]:
    """Head and lines: a choice a line, a metric a column, medians over the seeds."""
    shown = [metric for metric in metrics if any(metric in row for row in rows)]
    lines = []
    for choice in choices:
        members = [row for row in rows if row["choice"] == choice and row["level"] == level]
        if not members:
            continue
        cells = [_cell(members, metric) for metric in shown]
        note = next((str(row["note"]) for row in members if row["note"]), "")
        lines.append([choice, str(len(members)), *cells, note])
    return ["", "cases", *(LABELS[metric] for metric in shown), ""], lines


def _cell(rows: Sequence[Row], metric: str) -> str:
    values = [float(v) for row in rows if isinstance(v := row.get(metric), float | int)]
    return significant(float(np.median(values)), 3) if values else "–"
