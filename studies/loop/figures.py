"""The plots of a loop's page."""

from collections.abc import Sequence

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from identification.excitation.trajectory import Trajectory
from testbench.report.style import INSIDE, MUTED, TEMPLATE

from .outcome import Outcome, Place
from .wording import labelled

ACTS = "#1b7f4d"
OTHERS = ("#f0a860", "#c0392b", "#9467bd", "#8c564b", "#17becf")
FIRST, LATER = MUTED, INSIDE
RATE, COLUMNS = 100.0, 3


def probabilities(found: Outcome) -> go.Figure:
    """Probability of each effect that was named or not distinguished, by round; what acts in green."""
    places: list[Place] = list(found.acts)
    for each in found.rounds:
        places += [place for place in each.probabilities if place not in places]
    figure = go.Figure(layout={"template": TEMPLATE, "height": 320, "barmode": "group", "showlegend": True})
    rounds = [f"round {each.number}<br>{each.runs} runs" for each in found.rounds]
    for index, place in enumerate(places):
        acts = place in found.acts
        values = [100 * each.probabilities.get(place, 0.0) for each in found.rounds]
        figure.add_bar(
            x=rounds,
            y=values,
            name=labelled(place) + (" (acts)" if acts else ""),
            marker_color=ACTS if acts else OTHERS[(index - len(found.acts)) % len(OTHERS)],
            text=[f"{value:.0f} %" if value else "not named" for value in values],
            textposition="outside",
            cliponaxis=False,
        )
    return figure.update_yaxes(title="stated probability, %", range=[0, 108])


def motions(
    names: Sequence[str], units: Sequence[str], first: Trajectory, later: Trajectory, number: int
) -> go.Figure:
    """Position of every joint along the first motion and along that of a later round."""
    rows = -(-len(names) // COLUMNS)
    figure = make_subplots(
        rows=rows,
        cols=COLUMNS,
        subplot_titles=[f"{name} [{unit}]" for name, unit in zip(names, units, strict=True)],
        vertical_spacing=0.32 / rows,
        horizontal_spacing=0.06,
    )
    for label, motion, colour in (("round 1", first, FIRST), (f"round {number}", later, LATER)):
        time = np.arange(int(motion.duration * RATE) + 1) / RATE
        position = motion.evaluate(time)[0]
        for joint in range(len(names)):
            figure.add_scatter(
                x=time,
                y=position[:, joint],
                mode="lines",
                line={"color": colour, "width": 1.4},
                name=label,
                legendgroup=label,
                showlegend=joint == 0,
                row=joint // COLUMNS + 1,
                col=joint % COLUMNS + 1,
            )
    for column in range(1, COLUMNS + 1):
        figure.update_xaxes(title="time [s]", row=rows, col=column)
    figure.update_layout(template=TEMPLATE, height=120 + 210 * rows)
    return figure.update_layout(legend={"y": 1.08, "x": 0, "orientation": "h"})
