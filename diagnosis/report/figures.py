"""The diagnosis page's plots, as plotly figures."""

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from testbench.findings import torque_unit
from testbench.report.style import MEASURED, MUTED, POINTS, RESIDUAL, TEMPLATE, add_line, envelope

from ..correction.forward_gap import ForwardGap
from ..decision.findings import STAGES, Diagnosis
from .words import MOST_CANDIDATES, labelled

NOMINAL, PARAMETERS, EFFECTS, FLOOR = "#9aa3ad", "#f0a860", "#1f77b4", "#1b7f4d"
STAGE_NAMES = {"nominal": "as given", "parameters": "re-identified", "effects": "with the effects"}
STAGE_COLOURS = {"nominal": NOMINAL, "parameters": PARAMETERS, "effects": EFFECTS}
# The lowest noise floor that is drawn, as a share of the smallest bar, and the room around all.
FLOOR_SHOWN, MARGIN = 0.05, 0.5


def evidence(diagnosis: Diagnosis) -> go.Figure:
    """Probability of the candidates, likeliest on top; those named in blue."""
    ranked, named = diagnosis.likeliest[:MOST_CANDIDATES], {each.place for each in diagnosis.effects}
    figure = go.Figure(
        go.Bar(
            x=[100 * each.probability for each in ranked],
            y=[labelled(diagnosis.robot, each) for each in ranked],
            orientation="h",
            marker_color=[EFFECTS if each.place in named else MUTED for each in ranked],
            text=[f"{100 * each.probability:.0f} %" for each in ranked],
            textposition="outside",
            cliponaxis=False,
            customdata=[[each.score, each.reason] for each in ranked],
            hovertemplate="%{y}<br>%{x:.1f} %, score %{customdata[0]:.3g}<br>%{customdata[1]}<extra></extra>",
        ),
        layout={"template": TEMPLATE, "height": 80 + 26 * max(len(ranked), 2)},
    )
    figure.update_xaxes(title="probability, %", range=[0, 109])
    figure.update_yaxes(autorange="reversed", automargin=True, showgrid=False)
    return figure


def waterfall(diagnosis: Diagnosis) -> go.Figure:
    """From the model as given down to the noise floor, RMS torque error summed over the joints."""
    gap = diagnosis.gap
    nominal, parameters, effects, floor = (
        float(np.sum(v)) for v in (gap.nominal, gap.parameters, gap.effects, gap.noise_floor)
    )
    unit = torque_unit(diagnosis.robot)
    # In two lines: side by side on a narrow page, long names would be turned and cut off.
    steps = ["model<br>as given", "re-<br>identified", "effects<br>added", "left", "of it<br>noise"]
    heights = [nominal, parameters - nominal, effects - parameters, effects, floor]
    figure = go.Figure(
        go.Waterfall(
            x=steps,
            measure=["absolute", "relative", "relative", "total", "absolute"],
            y=heights,
            increasing_marker_color=RESIDUAL,
            decreasing_marker_color=FLOOR,
            totals_marker_color=EFFECTS,
            connector_line={"color": "#c6ccd3", "width": 1},
        ),
        layout={"template": TEMPLATE, "height": 330, "showlegend": False},
    )
    # Above every bar: below one that ends near zero the axis has its own labels.
    figure.add_scatter(
        x=steps,
        y=[nominal, max(nominal, parameters), max(parameters, effects), effects, floor],
        text=[f"{height:+.3g}" if 0 < place < 3 else f"{height:.3g}" for place, height in enumerate(heights)],
        mode="text",
        textposition="top center",
        cliponaxis=False,
        hoverinfo="skip",
    )
    figure.update_xaxes(tickangle=0, automargin=True)
    figure.update_yaxes(title=f"joints summed, {unit}", rangemode="tozero")
    return figure


def gap_by_joint(diagnosis: Diagnosis) -> go.Figure:
    """RMS torque error a joint at each stage, over the noise floor of that joint, log scale."""
    gap, names = diagnosis.gap, list(diagnosis.robot.joint_names)
    figure = go.Figure(layout={"template": TEMPLATE, "height": 330, "barmode": "group"})
    for index, stage in enumerate(STAGES):
        rms, (low, high) = getattr(gap, stage), gap.intervals[index]
        error = {"array": high - rms, "arrayminus": rms - low, "thickness": 1, "width": 3}
        figure.add_bar(
            x=names, y=rms, error_y=error, name=STAGE_NAMES[stage], marker_color=STAGE_COLOURS[stage]
        )
    marker = {"symbol": "line-ew", "size": 30, "line": {"width": 2.5, "color": FLOOR}}
    figure.add_scatter(x=names, y=gap.noise_floor, mode="markers", name="noise floor", marker=marker)
    # A floor that is next to nothing would leave no room for the bars.
    bars = np.array([getattr(gap, stage) for stage in STAGES])
    lowest = max(float(gap.noise_floor.min()), FLOOR_SHOWN * float(bars.min()))
    limits = np.log10([MARGIN * max(lowest, np.finfo(float).tiny), float(bars.max()) / MARGIN])
    figure.update_yaxes(
        title=f"RMS error, {torque_unit(diagnosis.robot)}",
        type="log",
        tickformat="~g",
        dtick="D2",
        range=limits.tolist(),
    )
    # Names may be long.
    figure.update_xaxes(automargin=True)
    return figure


def before_and_after(diagnosis: Diagnosis) -> go.Figure:
    """Residual of the re-identified model and of the corrected one, a panel a joint, in the worst run."""
    names, units = diagnosis.robot.joint_names, diagnosis.robot.units()
    first, last = diagnosis.parameters_only[1].residual, diagnosis.final[1].residual
    worst = diagnosis.runs_by_gap[0]
    run = diagnosis.prepared.runs[worst]
    rows = -(-len(names) // 2)
    cells = [[2 * row + column < len(names) for column in range(2)] for row in range(rows)]
    specs: list[list[dict[str, str] | None]] = [[{} if cell else None for cell in row] for row in cells]
    figure = make_subplots(
        rows=rows, cols=2, specs=specs, vertical_spacing=0.2 / rows, horizontal_spacing=0.08
    )
    for joint, name in enumerate(names):
        where = {"row": joint // 2 + 1, "col": joint % 2 + 1}
        kept = envelope(POINTS, first[worst][:, joint], last[worst][:, joint])
        for residual, label, colour in (
            (first[worst], "re-identified", PARAMETERS),
            (last[worst], "with the effects", MEASURED),
        ):
            masked = np.where(run.used[:, joint], residual[:, joint], np.nan)[kept]
            add_line(figure, run.time[kept], masked, label, colour, showlegend=joint == 0, **where)
        figure.update_yaxes(title=f"{name}, {units[joint]}", title_standoff=4, **where)
        if joint + 2 >= len(names):
            figure.update_xaxes(title=f"time in {run.name}, s", **where)
    return figure.update_layout(template=TEMPLATE, height=170 * rows + 70, legend_y=1 + 0.03 / rows)


def forward(diagnosis: Diagnosis, gap: ForwardGap) -> go.Figure:
    """Closed loop: simulated less logged motion and torque a joint, at each stage."""
    names = list(diagnosis.robot.joint_names)
    figure = make_subplots(rows=1, cols=2, horizontal_spacing=0.1)
    for column, values in ((1, gap.motion), (2, gap.torque)):
        for stage, rms in values.items():
            figure.add_bar(
                x=names,
                y=rms,
                name=STAGE_NAMES[stage],
                marker_color=STAGE_COLOURS[stage],
                showlegend=column == 1,
                row=1,
                col=column,
            )
    slides = diagnosis.robot.chain.is_slide
    length = "m" if slides.all() else ("rad (m for a slide joint)" if slides.any() else "rad")
    figure.update_yaxes(type="log", tickformat=".0e", dtick=1)
    figure.update_yaxes(title=f"motion, RMS, {length}", col=1)
    figure.update_yaxes(title=f"torque, RMS, {torque_unit(diagnosis.robot)}", col=2)
    return figure.update_layout(template=TEMPLATE, barmode="group", height=300)
