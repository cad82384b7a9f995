"""The plots of a comparison, made from its rows; every choice keeps its colour."""

from collections.abc import Sequence

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray
from plotly.colors import qualitative

from ..report.style import TEMPLATE
from .case import Row

COLOURS = qualitative.D3 + qualitative.Set2
LOGARITHMIC = 3.0
SYMBOLS = ("circle", "square", "diamond", "triangle-up", "x", "star")


def numbers(rows: Sequence[Row], metric: str) -> NDArray[np.float64]:
    """The known, positive values of a metric; zero has no place on a logarithmic axis."""
    values = np.array([v for row in rows if isinstance(v := row.get(metric), float | int)], dtype=float)
    return values[np.isfinite(values) & (values > 0)]


def against_level(
    rows: Sequence[Row], choices: Sequence[str], levels: Sequence[str], metric: str, title: str
) -> go.Figure:
    """Median over seeds of each choice at each level, with the quartiles as bars."""
    figure = go.Figure(layout={"template": TEMPLATE, "height": 430})
    for index, choice in enumerate(choices):
        places, middles, lows, highs = [], [], [], []
        for place, level in enumerate(levels):
            found = numbers(
                [row for row in rows if row["choice"] == choice and row["level"] == level], metric
            )
            if len(found):
                low, middle, high = np.quantile(found, [0.25, 0.5, 0.75])
                # Side by side, so that the bars of neighbours can be distinguished.
                places.append(place + 0.03 * (index - (len(choices) - 1) / 2))
                middles.append(middle)
                lows.append(middle - low)
                highs.append(high - middle)
        if places:
            figure.add_scatter(
                x=places,
                y=middles,
                error_y={"type": "data", "array": highs, "arrayminus": lows, "thickness": 1, "width": 2},
                name=choice,
                mode="lines+markers",
                line_color=_colour(index),
                marker_symbol=SYMBOLS[index % len(SYMBOLS)],
            )
    figure.update_xaxes(tickvals=list(range(len(levels))), ticktext=list(levels))
    return _beside(_scaled(figure, "y", title))


def boxes(rows: Sequence[Row], choices: Sequence[str], metric: str, title: str) -> go.Figure:
    """Every seed or start of each choice, as a box with its points."""
    figure = go.Figure(layout={"template": TEMPLATE, "height": 380})
    for index, choice in enumerate(choices):
        found = numbers([row for row in rows if row["choice"] == choice], metric)
        if len(found):
            figure.add_box(
                y=found, name=choice, boxpoints="all", jitter=0.4, pointpos=0, marker_size=4, line_width=1.2,
                marker_color=_colour(index), showlegend=False,
            )  # fmt: skip
    return _scaled(figure.update_xaxes(automargin=True, tickangle=20), "y", title)


def time_against(
    rows: Sequence[Row], choices: Sequence[str], levels: Sequence[str], metric: str, title: str
) -> go.Figure:
    """Median time against median of a metric: the lower left corner is best. A symbol a level."""
    figure = go.Figure(layout={"template": TEMPLATE, "height": 430})
    for place, level in enumerate(levels):
        for index, choice in enumerate(choices):
            members = [row for row in rows if row["choice"] == choice and row["level"] == level]
            seconds, found = numbers(members, "seconds"), numbers(members, metric)
            if len(seconds) and len(found):
                figure.add_scatter(
                    x=[np.median(seconds)],
                    y=[np.median(found)],
                    name=choice,
                    legendgroup=choice,
                    showlegend=place == 0,
                    mode="markers",
                    marker={"color": _colour(index), "size": 11, "symbol": SYMBOLS[place % len(SYMBOLS)]},
                    hovertemplate=f"{choice}, {level}<br>%{{x:.3g}} s, %{{y:.3g}}<extra></extra>",
                )
    return _beside(_scaled(_scaled(figure, "x", "processor time, s"), "y", title))


def bars(names: Sequence[str], values: Sequence[float], title: str) -> go.Figure:
    """One logarithmic bar a name, longest at the bottom."""
    figure = go.Figure(layout={"template": TEMPLATE, "height": 90 + 30 * len(names)})
    figure.add_bar(x=values, y=names, orientation="h", marker_color=COLOURS[0])
    return _scaled(figure, "x", title).update_layout(margin_l=210)


def _scaled(figure: go.Figure, axis: str, title: str) -> go.Figure:
    """A logarithmic axis where the values span a decade's half or more, else a linear one; both labelled."""
    values = np.concatenate([np.asarray(trace[axis], dtype=float) for trace in figure.data] or [np.ones(1)])
    wide = values.max() > LOGARITHMIC * values.min()
    scale = {"type": "log", "dtick": "D2"} if wide else {"type": "linear"}
    return figure.update_layout(
        {f"{axis}axis": {"title": {"text": title}, "tickformat": "~g", "automargin": True, **scale}}
    )


def _colour(index: int) -> str:
    return COLOURS[index % len(COLOURS)]


def _beside(figure: go.Figure) -> go.Figure:
    """The legend to the right: there are too many names for a line above."""
    legend = {"orientation": "v", "x": 1.01, "y": 1, "xanchor": "left", "yanchor": "top"}
    return figure.update_layout(legend=legend, margin_r=210)
