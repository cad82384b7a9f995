"""Plots of one run or one motion over time, as plotly figures."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray
from plotly.subplots import make_subplots

from .figures import JOINT_COLOURS
from .style import POINTS, TEMPLATE, add_line, envelope

Array = NDArray[np.float64]


def by_quantity(time: Array, quantities: Mapping[str, Array], names: tuple[str, ...]) -> go.Figure:
    """A panel a quantity, a line a joint. time: (N,) s. quantities: (N, n) by their labels with units."""
    figure = _panels(len(quantities))
    for row, (label, values) in enumerate(quantities.items(), start=1):
        for joint, name in enumerate(names):
            colour = JOINT_COLOURS[joint % len(JOINT_COLOURS)]
            _line(figure, row, time, values[:, joint], name, colour, row == 1)
        figure.update_yaxes(title=label, row=row, col=1)
    return figure


def by_joint(
    time: Array, torques: Mapping[str, Array], names: tuple[str, ...], units: tuple[str, ...]
) -> go.Figure:
    """A panel a joint, a line a torque. time: (N,) s. torques: (N, n) N·m (N) by their labels."""
    figure = _panels(len(names))
    for row, (name, unit) in enumerate(zip(names, units, strict=True), start=1):
        for colour, (label, torque) in zip(JOINT_COLOURS, torques.items(), strict=False):
            _line(figure, row, time, torque[:, row - 1], label, colour, row == 1)
        figure.update_yaxes(title=f"{name}, {unit}", row=row, col=1)
    return figure


def bars_by_joint(bars: Mapping[str, Array], names: tuple[str, ...], label: str) -> go.Figure:
    """Bars of each joint, side by side. bars: (n,) by what they are. label: of the axis, with the unit."""
    figure = go.Figure(layout={"template": TEMPLATE, "height": 320, "barmode": "group"})
    for colour, (name, values) in zip(JOINT_COLOURS, bars.items(), strict=False):
        figure.add_bar(x=list(names), y=values, name=name, marker_color=colour)
    figure.update_yaxes(title=label)
    return figure


def _panels(rows: int) -> go.Figure:
    """Panels over time, one below the other."""
    figure = make_subplots(rows=rows, cols=1, shared_xaxes=True, vertical_spacing=0.12 / rows)
    figure.update_xaxes(title="time, s", row=rows, col=1)
    return figure.update_layout(template=TEMPLATE, height=190 * rows + 90, legend_y=1 + 0.03 / rows)


def _line(
    figure: go.Figure, row: int, time: Array, values: Array, name: str, colour: str, in_legend: bool
) -> None:
    kept = envelope(POINTS, values)
    where: dict[str, Any] = {"row": row, "col": 1, "legendgroup": name, "showlegend": in_legend}
    add_line(figure, time[kept], values[kept], name, colour, **where)
