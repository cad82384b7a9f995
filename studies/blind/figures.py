"""The plots of a blind study's page."""

from collections.abc import Sequence

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray

from testbench.report.style import INSIDE, MUTED, OUTSIDE, TEMPLATE

from .judge import Row
from .merit import Reliability, material

Array = NDArray[np.float64]

KIND_COLOURS = {"single": "#1f77b4", "pair": "#ff7f0e", "triple": "#9467bd"}


def calibration(found: Reliability) -> go.Figure:
    """Reliability diagram: a point a bin, with the interval of what was so; the diagonal is calibrated."""
    figure = go.Figure(layout={"template": TEMPLATE, "height": 380})
    figure.add_scatter(
        x=[0, 1], y=[0, 1], mode="lines", line={"color": MUTED, "dash": "dash"}, name="calibrated"
    )
    values = [each.value or 0.0 for each in found.correct]
    bounds = [each.interval or (0.0, 0.0) for each in found.correct]
    figure.add_scatter(
        x=found.stated,
        y=values,
        error_y={
            "type": "data",
            "array": [high - value for value, (_, high) in zip(values, bounds, strict=True)],
            "arrayminus": [value - low for value, (low, _) in zip(values, bounds, strict=True)],
        },
        mode="markers+text",
        marker={"color": INSIDE, "size": 9},
        text=[f" {each.of}" for each in found.correct],
        textposition="middle right",
        name="named effects, number in the bin",
    )
    figure.update_xaxes(title="stated probability", range=[-0.02, 1.06])
    return figure.update_yaxes(title="share that acts", range=[-0.02, 1.04])


def risk(coverage: Array, wrong: Array) -> go.Figure:
    """Share of first names that do not act, as ever less probable ones are believed."""
    figure = go.Figure(layout={"template": TEMPLATE, "height": 380})
    figure.add_scatter(x=coverage, y=wrong, mode="lines", line_color=OUTSIDE, name="risk")
    figure.update_xaxes(title="coverage: share of all cases that get a name", rangemode="tozero")
    return figure.update_yaxes(title="share of the names that do not act", rangemode="tozero")


def confused(truths: Sequence[str], names: Sequence[str], counts: NDArray[np.int64]) -> go.Figure:
    """Counts of what is named first, a row what acts; colours by share of the row."""
    total = np.maximum(counts.sum(axis=1, keepdims=True), 1)
    figure = go.Figure(layout={"template": TEMPLATE, "height": 200 + 24 * len(truths)})
    figure.add_heatmap(
        z=counts / total,
        x=[name.replace("_", " ") for name in names],
        y=[name.replace("_", " ") for name in truths],
        text=np.where(counts > 0, counts.astype(str), ""),
        texttemplate="%{text}",
        colorscale="Blues",
        zmin=0,
        zmax=1,
        xgap=1,
        ygap=1,
        colorbar={"title": "share"},
    )
    figure.update_xaxes(tickangle=45, automargin=True)
    return figure.update_yaxes(autorange="reversed", automargin=True)


def by_severity(rows: Sequence[Row]) -> go.Figure:
    """Single cases of each effect along its severity; a full mark was found."""
    singles = [row for row in rows if row["kind"] == "single"]
    names = sorted({row["effect"] for row in singles}, reverse=True)
    figure = go.Figure(layout={"template": TEMPLATE, "height": 140 + 24 * len(names)})
    for label, found, colour, symbol in (
        ("found", True, INSIDE, "circle"),
        ("not found", False, OUTSIDE, "x"),
    ):
        chosen = [row for row in singles if bool(row["right"]) is found]
        figure.add_scatter(
            x=[row["severity"] for row in chosen],
            y=[row["effect"].replace("_", " ") for row in chosen],
            mode="markers",
            name=label,
            marker={"color": colour, "symbol": symbol, "size": 9, "opacity": 0.75},
            text=[f"{row['case']}: {row['acts']}<br>said {row['named'] or row['verdict']}" for row in chosen],
            hovertemplate="%{text}<extra></extra>",
        )
    figure.update_xaxes(title="severity, share of the typical range", range=[-0.02, 1.02])
    order = [name.replace("_", " ") for name in names]
    return figure.update_yaxes(categoryorder="array", categoryarray=order, automargin=True)


def closed(rows: Sequence[Row]) -> go.Figure:
    """Cumulative distribution of the share closed, a line a kind of case."""
    figure = go.Figure(layout={"template": TEMPLATE, "height": 380})
    for kind, colour in KIND_COLOURS.items():
        found = np.sort([row["closed"] for row in material(rows) if row["kind"] == kind])
        if found.size:
            figure.add_scatter(
                x=np.clip(found, -0.5, 1.5),
                y=np.arange(1, found.size + 1) / found.size,
                mode="lines+markers",
                line={"color": colour, "shape": "hv"},
                marker_size=4,
                name=kind,
            )
    figure.update_xaxes(title="share closed, cut off at -0.5 and 1.5")
    return figure.update_yaxes(title="share of the cases", range=[0, 1.02])
