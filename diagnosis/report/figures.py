"""The diagnosis page's plots, as plotly figures."""

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray
from plotly.subplots import make_subplots

from testbench.report.figures import MEASURED, MUTED, PREDICTED, RESIDUAL, TEMPLATE, envelope, single

from ..findings import Diagnosis, NamedEffect
from ..forward import STAGES, ForwardGap
from ..localisation import regime_shares
from .words import labelled, place, torque_unit

Array = NDArray[np.float64]

NOMINAL, PARAMETERS, EFFECTS, FLOOR = "#9aa3ad", "#f0a860", "#1f77b4", "#1b7f4d"
STAGE_NAMES = {"nominal": "as given", "parameters": "re-identified", "effects": "with the effects"}
STAGE_COLOURS = {"nominal": NOMINAL, "parameters": PARAMETERS, "effects": EFFECTS}
MOST_CANDIDATES = 12
POINTS, BINS, FEWEST = 900, 30, 4
HEAT = [[0.0, "#ffffff"], [0.15, "#fde3c8"], [0.5, "#f08a4b"], [1.0, "#a61e22"]]


def where(diagnosis: Diagnosis) -> go.Figure:
    """Share of the gap by joint and regime, as a heat map with its numbers.

    Regimes of speed, direction, load, acceleration and time overlap: each is a part of its joint's own share.
    """
    names = diagnosis.robot.joint_names
    hypothesis, fitted = diagnosis.parameters_only
    found = regime_shares(hypothesis.prepared, fitted.held_out, hypothesis.used)
    regimes = list(dict.fromkeys(each.regime for each in found))
    of_joint = {each.joint: each for each in diagnosis.where}
    shares = np.full((len(names), 1 + len(regimes)), np.nan)
    hover = np.full(shares.shape, "", dtype=object)
    units = diagnosis.robot.units()
    for joint, each in of_joint.items():
        shares[joint, 0] = 100 * each.share
        hover[joint, 0] = (
            f"{names[joint]}<br>{100 * each.share:.1f} % of the gap<br>"
            f"RMS {each.gap_rms:.3g} {units[joint]}, noise {each.noise_rms:.3g} {units[joint]}"
        )
    for part in found:
        if part.joint in of_joint:
            cell = part.joint, 1 + regimes.index(part.regime)
            shares[cell] = 100 * of_joint[part.joint].share * part.share
            hover[cell] = (
                f"{names[part.joint]}, {part.regime}<br>{100 * part.share:.0f} % of the joint's gap "
                f"({100 * part.low:.0f} to {100 * part.high:.0f} %)<br>{part.concentration:.2g} times as "
                f"dense as elsewhere<br>RMS {part.rms:.3g} {units[part.joint]}"
            )
    text = np.where(np.isnan(shares), "", np.char.add(np.char.mod("%.0f", np.nan_to_num(shares)), " %"))
    figure = go.Figure(
        go.Heatmap(
            z=shares,
            x=["all", *(regime.replace(" ", "<br>") for regime in regimes)],
            y=list(names),
            text=text,
            texttemplate="%{text}",
            hovertext=hover,
            hovertemplate="%{hovertext}<extra></extra>",
            colorscale=HEAT,
            zmin=0,
            zmax=max(float(np.nanmax(shares, initial=0.0)), 1.0),
            xgap=2,
            ygap=2,
            showscale=False,
        ),
        layout={"template": TEMPLATE, "height": 140 + 34 * len(names)},
    )
    figure.update_xaxes(side="top", showgrid=False, showline=False, tickangle=0)
    figure.update_yaxes(autorange="reversed", automargin=True, showgrid=False, showline=False)
    return figure.update_layout(margin={"l": 90, "r": 16, "t": 78, "b": 12})


def evidence(diagnosis: Diagnosis) -> go.Figure:
    """Probability of the candidates, likeliest on top; those named in blue."""
    ranked = sorted(diagnosis.ranked, key=lambda each: (-each.probability, -each.score))[:MOST_CANDIDATES]
    named = {(each.effect, each.joint, each.into) for each in diagnosis.effects}
    labels = [labelled(diagnosis.robot, each.effect, each.joint, each.into) for each in ranked]
    figure = go.Figure(
        go.Bar(
            x=[100 * each.probability for each in ranked],
            y=labels,
            orientation="h",
            marker_color=[
                EFFECTS if (each.effect, each.joint, each.into) in named else MUTED for each in ranked
            ],
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
    figure = go.Figure(
        go.Waterfall(
            x=["model as given", "re-identified", "effects added", "left", "of it noise"],
            measure=["absolute", "relative", "relative", "total", "absolute"],
            y=[nominal, parameters - nominal, effects - parameters, effects, floor],
            text=[
                f"{nominal:.3g}",
                f"{parameters - nominal:+.3g}",
                f"{effects - parameters:+.3g}",
                f"{effects:.3g}",
                f"{floor:.3g}",
            ],
            textposition="outside",
            cliponaxis=False,
            increasing_marker_color=RESIDUAL,
            decreasing_marker_color=FLOOR,
            totals_marker_color=EFFECTS,
            connector_line={"color": "#c6ccd3", "width": 1},
        ),
        layout={"template": TEMPLATE, "height": 330, "showlegend": False},
    )
    figure.update_yaxes(title=f"RMS torque error, sum over joints, {unit}", rangemode="tozero")
    return figure


def gap_by_joint(diagnosis: Diagnosis) -> go.Figure:
    """RMS torque error a joint at each stage, over the noise floor of that joint, log scale."""
    gap, names = diagnosis.gap, list(diagnosis.robot.joint_names)
    figure = go.Figure(layout={"template": TEMPLATE, "height": 330, "barmode": "group"})
    for index, stage in enumerate(STAGES):
        rms, error = getattr(gap, stage), None
        if gap.intervals is not None:
            low, high = gap.intervals[index]
            error = {"array": high - rms, "arrayminus": rms - low, "thickness": 1, "width": 3}
        figure.add_bar(
            x=names, y=rms, error_y=error, name=STAGE_NAMES[stage], marker_color=STAGE_COLOURS[stage]
        )
    marker = {"symbol": "line-ew", "size": 30, "line": {"width": 2.5, "color": FLOOR}}
    figure.add_scatter(x=names, y=gap.noise_floor, mode="markers", name="noise floor", marker=marker)
    figure.update_yaxes(title=f"RMS error, {torque_unit(diagnosis.robot)}", type="log", tickformat="~g")
    return figure


def signature(diagnosis: Diagnosis, named: NamedEffect) -> go.Figure:
    """What is left without the effect over velocity, position and time, with the fitted law over it.

    The residual before is the final model's with this effect's own torque put back, so that the points
    do not depend on what re-identification alone would have swallowed.
    """
    joint = _shown_joint(diagnosis, named)
    robot, runs = diagnosis.robot, diagnosis.prepared.runs
    law, before = partial_residual(diagnosis, named)
    used = np.concatenate([run.used[:, joint] for run in runs])
    # A coupling's friction is on the summed speed of its two joints.
    moving = [joint] if named.into is None or named.joint is None else [named.joint, named.into]
    velocity = np.concatenate([run.dq[:, moving].sum(axis=1) for run in runs])[used]
    position = np.concatenate([run.q[:, joint] for run in runs])[used]
    left, torque = np.concatenate(before)[:, joint][used], np.concatenate(law)[:, joint][used]
    slide = robot.chain.is_slide[joint]
    panels = (
        (velocity, ("summed " if len(moving) > 1 else "") + "velocity, " + ("m/s" if slide else "rad/s")),
        (position, "position, " + ("m" if slide else "rad")),
    )
    figure = make_subplots(rows=1, cols=3, horizontal_spacing=0.07, column_widths=[0.3, 0.3, 0.4])
    every = slice(None, None, max(1, len(left) // POINTS))
    for column, (x, axis) in enumerate(panels, start=1):
        where = {"row": 1, "col": column}
        figure.add_scattergl(
            x=single(x[every]),
            y=single(left[every]),
            name="residual before",
            mode="markers",
            marker={"size": 3, "color": MUTED, "opacity": 0.55},
            showlegend=column == 1,
            **where,
        )
        figure.add_scattergl(
            x=single(x[every]),
            y=single(torque[every]),
            name="fitted law",
            mode="markers",
            marker={"size": 3, "color": PREDICTED, "opacity": 0.5},
            showlegend=column == 1,
            **where,
        )
        for y, colour, label in ((left, "#3c4650", "its mean"), (torque, "#c25a00", "the law's mean")):
            centres, means = binned(x, y)
            figure.add_scatter(
                x=single(centres),
                y=single(means),
                mode="lines",
                name=label,
                line={"color": colour, "width": 2},
                showlegend=column == 1,
                **where,
            )
        figure.update_xaxes(title=axis, **where)
    run = int(np.argmax([np.sum(torque[:, joint] ** 2) for torque in law]))
    shown = runs[run]
    kept = envelope(POINTS, before[run][:, joint], law[run][:, joint])
    for values, name, colour, width in (
        (before[run][:, joint], "residual before", MUTED, 1.4),
        (law[run][:, joint], "fitted law", PREDICTED, 1.4),
    ):
        masked = np.where(shown.used[:, joint], values, np.nan)[kept]
        figure.add_scatter(
            x=single(shown.time[kept]),
            y=single(masked),
            name=name,
            mode="lines",
            line={"color": colour, "width": width},
            showlegend=False,
            row=1,
            col=3,
        )
    figure.update_xaxes(title=f"time in {shown.name}, s", row=1, col=3)
    figure.update_yaxes(title=f"{robot.joint_names[joint]}, {robot.units()[joint]}", row=1, col=1)
    return figure.update_layout(template=TEMPLATE, height=320, legend_y=1.03)


def partial_residual(diagnosis: Diagnosis, named: NamedEffect) -> tuple[list[Array], list[Array]]:
    """A run each, (M, n) N·m: the effect's fitted torque, and the residual with that torque put back."""
    hypothesis, fitted = diagnosis.final
    start = hypothesis.parameters
    for accepted in hypothesis.accepted:
        values = fitted.values[start : start + accepted.count]
        if accepted.place == (named.effect, named.joint, named.into):
            law = [columns @ values for columns in accepted.columns]
            return law, [r + torque for r, torque in zip(fitted.residual, law, strict=True)]
        start += accepted.count
    raise KeyError(f"{named.effect} is not in the final hypothesis")


def before_and_after(diagnosis: Diagnosis) -> go.Figure:
    """Residual of the re-identified model and of the corrected one, a panel a joint, in the worst run."""
    names, units = diagnosis.robot.joint_names, diagnosis.robot.units()
    first, last = diagnosis.parameters_only[1].residual, diagnosis.final[1].residual
    worst = int(np.argmax([np.mean((r * _scale(diagnosis)) ** 2) for r in first]))
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
            figure.add_scatter(
                x=single(run.time[kept]),
                y=single(masked),
                mode="lines",
                name=label,
                line={"color": colour, "width": 1.1},
                showlegend=joint == 0,
                **where,
            )
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


def binned(x: Array, y: Array) -> tuple[Array, Array]:
    """Centres and means of the bins of x that hold at least a few samples."""
    if len(x) == 0:
        return np.empty(0), np.empty(0)
    edges = np.linspace(x.min(), x.max(), BINS + 1)
    index = np.clip(np.digitize(x, edges) - 1, 0, BINS - 1)
    counts = np.bincount(index, minlength=BINS)
    sums = np.bincount(index, weights=y, minlength=BINS)
    full = counts >= FEWEST
    return ((edges[:-1] + edges[1:]) / 2)[full], sums[full] / counts[full]


def signature_caption(diagnosis: Diagnosis, named: NamedEffect) -> str:
    """What a signature plot shows, in words."""
    shown = diagnosis.robot.joint_names[_shown_joint(diagnosis, named)]
    at = place(diagnosis.robot, named.joint, named.into)
    return f"{labelled(diagnosis.robot, named.effect, named.joint, named.into)}" + (
        "" if shown == at else f": torque of {shown}"
    )


def _shown_joint(diagnosis: Diagnosis, named: NamedEffect) -> int:
    """The joint on which the effect's torque stands out most against what is left."""
    if named.joint is not None and named.joint in named.candidate.member.rows:
        return named.joint
    law = np.concatenate(partial_residual(diagnosis, named)[0])
    return int(np.argmax(np.mean(law**2, axis=0) * _scale(diagnosis) ** 2))


def _scale(diagnosis: Diagnosis) -> Array:
    """One over each joint's remaining residual, (n,)."""
    return np.sqrt(diagnosis.final[1].weights)
